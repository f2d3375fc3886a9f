//! `cellwire certificates`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context as _, Result, ensure};
use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, CustomExtension, DnType, ExtendedKeyUsagePurpose,
    IsCa, KeyPair, KeyUsagePurpose,
};
use serde_json::json;

use cellwire_io::input::time;
use cellwire_io::output::log;

/// Makes certificates to try TLS with: those of an authority, a server and clients.
///
/// In the folder are then authority.pem, server.pem and server.key, client.pem and client.key, and a client's certificate
/// and key for each --role, named after it. The key of the authority is not kept: whoever wants another certificate makes
/// all again, in another folder. For a plant, take those of its own authority.
///
/// A role is what Modbus/TCP Security has in a client's certificate.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The folder, which is made, or is empty
    folder: PathBuf,
    /// A name or an address of the server
    #[arg(long, value_name = "NAME", default_values = ["localhost", "127.0.0.1"])]
    name: Vec<String>,
    /// The role of another client
    #[arg(long, value_name = "ROLE")]
    role: Vec<String>,
    /// The time for which they are valid
    #[arg(long = "for", value_name = "TIME", default_value = "365d", value_parser = time(Duration::from_secs(1)..=MAX_VALIDITY))]
    valid: Duration,
}

/// The longest validity of a certificate: 20 years.
const MAX_VALIDITY: Duration = Duration::from_secs(20 * 365 * 86_400);

const EXAMPLES: &str = "\
Examples:
  cellwire certificates tls --role operator
  cellwire simulate fanuc --listen 8020 --tls-cert tls/server.pem --tls-key tls/server.key
  echo '{\"function\":3,\"address\":0,\"quantity\":37}' | cellwire modbus send localhost:8020 --tls tls/authority.pem";

/// Makes them.
///
/// # Errors
/// When the folder is not empty, a name or a role is not valid, or a file cannot be written.
pub fn run(args: &Args) -> Result<bool> {
    let folder = &args.folder;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let is_empty = fs::read_dir(folder).is_ok_and(|mut files| files.next().is_none());
    ensure!(is_empty, "{} is not empty: name another folder", folder.display());
    for role in &args.role {
        let is_name = !role.is_empty() && role.chars().all(|c| c.is_alphanumeric() || "-_ ".contains(c));
        ensure!(
            is_name && role != "server" && role != "client",
            "--role {role:?}: it names a file: letters, digits, - and _"
        );
    }
    let mut authority = args.params("cellwire test authority", &[])?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let authority = CertifiedIssuer::self_signed(authority, KeyPair::generate()?)?;
    fs::write(folder.join("authority.pem"), authority.pem())?;
    let mut server = args.params("server", &args.name)?;
    server.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    sign(folder, "server", &server, &authority)?;
    let roles = args.role.iter().map(|role| (role.as_str(), Some(role.as_str())));
    let mut clients = Vec::new();
    for (name, role) in [("client", None)].into_iter().chain(roles) {
        let mut client = args.params(name, &[])?;
        client.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        client.custom_extensions.extend(role.map(of_role).transpose()?);
        sign(folder, name, &client, &authority)?;
        clients.push(json!({"certificate": folder.join(format!("{name}.pem")), "role": role}));
    }
    log(&json!({
        "authority": folder.join("authority.pem"), "server": folder.join("server.pem"), "names": args.name,
        "clients": clients,
    }))?;
    Ok(true)
}

impl Args {
    fn params(&self, name: &str, names: &[String]) -> Result<CertificateParams> {
        let mut params =
            CertificateParams::new(names).with_context(|| format!("--name {}", names.join(", ")))?;
        params.distinguished_name.push(DnType::CommonName, name);
        let now = SystemTime::now();
        params.not_before = (now - Duration::from_secs(3600)).into(); // clocks differ
        params.not_after = (now + self.valid).into();
        Ok(params)
    }
}

/// Writes a certificate and its key.
fn sign(
    folder: &Path,
    name: &str,
    params: &CertificateParams,
    authority: &CertifiedIssuer<'_, KeyPair>,
) -> Result<()> {
    let key = KeyPair::generate()?;
    let certificate = params.signed_by(&key, authority)?.pem();
    fs::write(folder.join(format!("{name}.pem")), certificate)?;
    Ok(secret(&folder.join(format!("{name}.key")), &key.serialize_pem())?)
}

/// Writes a file that only the user may read; elsewhere than on Unix, its folder decides the access.
fn secret(path: &Path, text: &str) -> std::io::Result<()> {
    let mut options = fs::OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    std::io::Write::write_all(&mut options.write(true).create_new(true).open(path)?, text.as_bytes())
}

/// Returns the extension of a role: a UTF8String.
fn of_role(role: &str) -> Result<CustomExtension> {
    const ROLE: [u64; 9] = [1, 3, 6, 1, 4, 1, 50_316, 802, 1];
    let length = u8::try_from(role.len()).ok().filter(|length| *length < 0x80);
    let length = length.with_context(|| format!("--role {role}: more than 127 bytes"))?;
    Ok(CustomExtension::from_oid_content(&ROLE, [&[0x0C, length], role.as_bytes()].concat()))
}
