//! Modbus in TLS: the role of a client's certificate decides on its access.

#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the tests have sockets")]

use std::path::{Path, PathBuf};

use fanuc_hmi_modbus::robot_session::tls::{Identity, client as client_config, server};
use fanuc_hmi_modbus::robot_session::tokio::Tcp;
use fanuc_hmi_modbus::robot_session::tokio::tls::{Tls, serve};
use fanuc_hmi_modbus::security::{Access, GuardedRegisters, RoleError, role};
use fanuc_hmi_modbus::tokio::{Client, Error, client};
use fanuc_hmi_modbus::{ClientConfig, Exception, Server, ServerConfig};
use proptest::prelude::*;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, CustomExtension, DnType, IsCa, KeyPair};
use tokio::net::TcpListener;

use crate::common::Bank;

const ROLE: [u64; 9] = [1, 3, 6, 1, 4, 1, 50316, 802, 1];

/// Returns a certificate whose extension for the role has this content.
fn certificate(
    issuer: &CertifiedIssuer<'_, KeyPair>,
    key: &KeyPair,
    name: &str,
    roles: &[&[u8]],
) -> rcgen::Certificate {
    let mut params = CertificateParams::new([name.to_owned()]).unwrap();
    params.custom_extensions =
        roles.iter().map(|content| CustomExtension::from_oid_content(&ROLE, content.to_vec())).collect();
    params.signed_by(key, issuer).unwrap()
}

fn utf8(text: &str) -> Vec<u8> {
    [&[0x0C, u8::try_from(text.len()).unwrap()], text.as_bytes()].concat()
}

fn authority() -> CertifiedIssuer<'static, KeyPair> {
    let mut params = CertificateParams::new([]).unwrap();
    params.distinguished_name.push(DnType::CommonName, "cell");
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap()
}

struct Files<'a>(&'a Path);

impl Files<'_> {
    fn write(&self, name: &str, issuer: &CertifiedIssuer<'_, KeyPair>, roles: &[&[u8]]) -> [PathBuf; 2] {
        let key = KeyPair::generate().unwrap();
        let files = ["pem", "key"].map(|kind| self.0.join(format!("{name}.{kind}")));
        std::fs::write(&files[0], certificate(issuer, &key, name, roles).pem()).unwrap();
        std::fs::write(&files[1], key.serialize_pem()).unwrap();
        files
    }
}

#[tokio::test]
async fn a_role_decides_what_a_client_may_do() {
    let folder = tempfile::tempdir().unwrap();
    let (files, issuer) = (Files(folder.path()), authority());
    let ca = folder.path().join("ca.pem");
    std::fs::write(&ca, issuer.pem()).unwrap();
    let [certificate, key] = &files.write("localhost", &issuer, &[]);
    let config = server(Identity { certificate, key }, Some(&ca)).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let session = |_, met: Result<&fanuc_hmi_modbus::robot_session::tls::rustls::CommonState, _>| {
        let role = role(met.ok()?.peer_certificates()?.first()?).ok()?.unwrap_or("none").to_owned();
        let allows = move |access: Access| match access.function {
            1..=4 => role != "none",
            _ => role == "engineer" && access.address >= 10,
        };
        Server::<_>::new(ServerConfig::tcp(), GuardedRegisters::new(Bank::new(), allows)).ok()
    };
    tokio::spawn(serve(listener, 8, config, session, |_, _, _| {}));
    let to = |roles: &[&[u8]], name: &str| -> Client {
        let [certificate, key] = &files.write(name, &issuer, roles);
        let config = client_config(&ca, Some(Identity { certificate, key })).unwrap();
        let tls = Tls::dial(Tcp::new(address.clone()), config, "localhost").unwrap();
        let (client, task) = client(ClientConfig::tcp(), tls).unwrap();
        tokio::spawn(task.run());
        client
    };
    let refused = |result: Result<(), Error>| {
        assert!(matches!(result, Err(Error::Exception(Exception::IllegalFunction))), "{result:?}");
    };
    let engineer = to(&[&utf8("engineer")], "engineer");
    engineer.write_registers(10, &[7, 8]).await.unwrap();
    assert_eq!(engineer.read_holding_registers(10..12).await.unwrap(), [7, 8]);
    refused(engineer.write_register(9, 1).await);
    let operator = to(&[&utf8("operator")], "operator");
    operator.read_coils(0..3).await.unwrap();
    operator.read_holding_registers(10..12).await.unwrap();
    refused(operator.write_register(10, 1).await);
    refused(operator.write_coil(10, true).await);
    refused(operator.mask_write_register(10, 1, 1).await);
    let nobody = to(&[], "nobody");
    refused(nobody.read_holding_registers(0..1).await.map(drop));
    // A certificate with two roles has no valid role, and gets no connection.
    let two = to(&[&utf8("engineer"), &utf8("operator")], "two");
    assert!(two.read_holding_registers(0..1).await.is_err());
}

#[test]
fn a_role_is_read_from_a_certificate() {
    let (issuer, key) = (authority(), KeyPair::generate().unwrap());
    let of = |roles: &[&[u8]]| certificate(&issuer, &key, "x", roles).der().to_vec();
    assert_eq!(role(&of(&[])), Ok(None));
    assert_eq!(role(&of(&[&utf8("Wärter")])), Ok(Some("Wärter")));
    assert_eq!(role(&of(&[&utf8(&"r".repeat(100))])), Ok(Some(&*"r".repeat(100))));
    assert_eq!(role(&of(&[&[0x13, 2, b'o', b'k']])), Err(RoleError::Role));
    assert_eq!(role(&of(&[&[0x0C, 2, 0xFF, 0xFE]])), Err(RoleError::Role));
    assert_eq!(role(&of(&[&[&utf8("a")[..], &[0]].concat()])), Err(RoleError::Role));
    assert_eq!(role(&of(&[&utf8("a"), &utf8("b")])), Err(RoleError::Several));
    let whole = of(&[&utf8("operator")]);
    for length in 0..whole.len() {
        assert_eq!(role(&whole[..length]), Err(RoleError::Certificate), "{length} bytes");
    }
}

proptest! {
    #[test]
    fn any_bytes_have_a_role_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = role(&bytes);
    }
}
