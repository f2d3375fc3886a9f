//! A connection to an MQTT broker: one attempt, one session, one end.
//!
//! A new connection does not resend messages that were unacknowledged on an earlier one. The caller resends those that are still
//! wanted.

mod three;

use std::collections::{HashMap, VecDeque};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use rumqttc::v5::mqttbytes::v5::{
    DisconnectReasonCode, Filter, LastWill, PubAckReason, RetainForwardRule, SubscribeReasonCode,
};
use rumqttc::v5::mqttbytes::{Error as Malformed, QoS};
use rumqttc::v5::{AsyncClient, ConnectionError, Event, EventLoop, Incoming, MqttOptions, StateError};
use rumqttc::{Outgoing, TlsConfiguration, Transport};
use tokio::runtime::Builder;
use tokio_rustls::rustls::pki_types::CertificateDer;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;

/// The number of messages that may wait for the socket.
const MAX_UNSENT: usize = 256;
/// The longest packet that is read: a broker withholds a longer one silently, so this is far above the longest message that is
/// accepted.
const MAX_PACKET_LEN: u32 = 16 << 20;
/// The reason code "packet too large": the standard does not list it for PUBACK, and mosquitto sends it nevertheless.
const TOO_LARGE: u8 = 0x95;
/// The number of messages in flight; a broker may request fewer.
const IN_FLIGHT: u16 = 1000;

/// The address of the broker, and the identity of the client.
#[derive(Debug, Clone)]
pub struct Options {
    /// The broker's name or address, which its certificate must contain.
    pub host: String,
    /// The TCP port of the broker.
    pub port: u16,
    /// The URL, if the broker is reached over a WebSocket; otherwise `None`.
    pub url: Option<String>,
    /// The client's name: a broker ends the connection of another client that has it.
    pub client: String,
    /// The user name and password; `None` without a login.
    pub login: Option<(String, Password)>,
    /// The TLS of the connection; `None`: it is not encrypted.
    pub tls: Option<Tls>,
    /// The version of the protocol.
    pub version: Version,
    /// The keep-alive time: after 1.5 times this without a message the broker considers the client disconnected.
    pub keep_alive: Duration,
    /// The will: a topic and its message, which the broker publishes then with QoS 1.
    pub will: (String, Vec<u8>),
}

/// A version of MQTT.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Deserialize)]
pub enum Version {
    /// MQTT 5, which has reasons.
    #[default]
    #[serde(rename = "5")]
    Five,
    /// MQTT 3.1.1, which has no reasons.
    #[serde(rename = "3.1.1")]
    Three,
}

/// A password, which nothing prints.
#[derive(Clone)]
pub struct Password(pub String);

/// PEM texts.
#[derive(Debug, Clone)]
pub struct Tls {
    /// The certificates of the authorities that may vouch for the broker, as PEM.
    pub authorities: Vec<u8>,
    /// The client's own certificate and its key, as PEM; `None` without one.
    pub client: Option<(Vec<u8>, Password)>,
}

/// An event of a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BrokerEvent {
    /// The broker has accepted the connection. The maximum packet size in bytes; `None` if the broker does not state one.
    Connected(Option<u32>),
    /// The broker has accepted every subscription.
    Subscribed,
    /// A message of a subscribed topic has come.
    Message {
        /// The topic of the message.
        topic: String,
        /// The payload of the message.
        payload: Vec<u8>,
        /// Whether the message is retained, or its sender has requested that it be.
        is_retained: bool,
    },
    /// A message was dropped because it is longer than 16 MiB.
    Skipped {
        /// The topic of the message.
        topic: String,
        /// The length of the message in bytes.
        length: usize,
    },
    /// The broker has the message of this token; with QoS 0, the socket has it.
    Published(u64),
    /// The broker does not take a message.
    Rejected {
        /// The token of the message.
        token: u64,
        /// The reason of the refusal, for the log.
        why: String,
        /// The scope of the refusal.
        refusal: Refusal,
    },
    /// The broker does not take a message without a token; the reason.
    NotTaken(String),
    /// The broker rejects a message that is too long, without its identity; [`Closed`](Self::Closed) follows.
    TooLong,
    /// Another client has connected with the same name; [`Closed`](Self::Closed) follows.
    TakenOver,
    /// The connection has ended; the reason. Nothing follows.
    Closed(String),
}

/// The scope of a refusal: the messages that the broker would still take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// Refuses every message of this topic until the broker's access control is changed.
    Topic,
    /// Refuses this message whenever it is sent; the broker takes others.
    Message,
    /// May pass: the broker may take the same message later.
    Passing,
}

/// A connection; its end is [`BrokerEvent::Closed`].
#[allow(missing_debug_implementations, reason = "rumqttc's client has none")]
pub struct Session {
    client: Client,
    sent: Arc<Mutex<VecDeque<Option<u64>>>>,
}

enum Client {
    Five(AsyncClient),
    Three(rumqttc::AsyncClient),
}

impl Session {
    /// Begins to connect. `report` is called by a thread of the connection.
    ///
    /// # Errors
    /// If the system has no room for a thread, or no descriptor.
    pub fn open(options: &Options, report: impl Fn(BrokerEvent) + Send + 'static) -> Result<Self> {
        let sent = Arc::new(Mutex::new(VecDeque::new()));
        let shared = Arc::clone(&sent);
        let thread = thread::Builder::new().name("broker".into());
        // The runtime opens descriptors, and the system may have run out of them.
        let runtime =
            Builder::new_current_thread().enable_all().build().context("no runtime for the connection")?;
        let (client, thread) = match options.version {
            Version::Five => {
                let (client, connection) = open(options);
                let run = move || runtime.block_on(run(connection, &shared, report));
                (Client::Five(client), thread.spawn(run))
            }
            Version::Three => {
                let (client, connection) = three::open(options);
                let run = move || runtime.block_on(three::run(connection, &shared, report));
                (Client::Three(client), thread.spawn(run))
            }
        };
        thread.context("cannot start the broker's thread")?;
        Ok(Self { client, sent })
    }

    /// Subscribes to these topics, with QoS 1: to messages from now on, and for `kept` also to those that the broker has stored.
    pub fn subscribe(&self, topics: &[String], kept: &[String]) {
        let filter = |topic: &String| Filter::new(topic.as_str(), QoS::AtLeastOnce);
        let fresh = |topic| Filter {
            preserve_retain: true,
            retain_forward_rule: RetainForwardRule::Never,
            ..filter(topic)
        };
        let filters = topics.iter().map(fresh).chain(kept.iter().map(filter));
        match &self.client {
            // A connection that has ended has reported it.
            Client::Five(client) => drop(client.try_subscribe_many(filters)),
            Client::Three(client) => three::subscribe(client, topics.iter().chain(kept)),
        }
    }

    /// Publishes a message: with QoS 0, or with QoS 1. The outcome of a message with a token is reported. Returns false if
    /// there is no free space yet.
    pub fn publish(&self, topic: &str, payload: Vec<u8>, acknowledged: bool, token: Option<u64>) -> bool {
        self.send(topic, payload, acknowledged, token, false)
    }

    /// Publishes a message that the broker stores, with QoS 1; an empty one removes it. Returns false if there is no free
    /// space yet.
    pub fn store(&self, topic: &str, payload: Vec<u8>) -> bool {
        self.send(topic, payload, true, None, true)
    }

    fn send(
        &self,
        topic: &str,
        payload: Vec<u8>,
        acknowledged: bool,
        token: Option<u64>,
        retain: bool,
    ) -> bool {
        let qos = if acknowledged { QoS::AtLeastOnce } else { QoS::AtMostOnce };
        // The connection's thread takes the tokens in the order of its publications: that is the order of these calls.
        let mut sent = lock(&self.sent);
        sent.push_back(token);
        let is_taken = match &self.client {
            Client::Five(client) => client.try_publish(topic, qos, retain, payload).is_ok(),
            Client::Three(client) => {
                let qos = if acknowledged { rumqttc::QoS::AtLeastOnce } else { rumqttc::QoS::AtMostOnce };
                client.try_publish(topic, qos, retain, payload).is_ok()
            }
        };
        if !is_taken {
            sent.pop_back();
        }
        is_taken
    }

    /// Returns the length of a message's packet in bytes.
    pub fn packet_len(topic: &str, payload: &[u8], acknowledged: bool) -> usize {
        // The topic has its length before it, then follow the packet's number and the length of no properties.
        let rest = 2 + topic.len() + if acknowledged { 2 } else { 0 } + 1 + payload.len();
        let length = match rest {
            0..0x80 => 1,
            0x80..0x4000 => 2,
            0x4000..0x20_0000 => 3,
            _ => 4,
        };
        1 + length + rest
    }

    /// Ends the connection after the published messages: the broker does not publish the will.
    pub fn close(&self) {
        match &self.client {
            Client::Five(client) => drop(client.try_disconnect()),
            Client::Three(client) => drop(client.try_disconnect()),
        }
    }
}

fn open(options: &Options) -> (AsyncClient, EventLoop) {
    let mut mqtt = MqttOptions::new(&options.client, options.place(), options.port);
    mqtt.set_clean_start(true);
    mqtt.set_keep_alive(options.keep_alive);
    mqtt.set_max_packet_size(Some(MAX_PACKET_LEN));
    mqtt.set_outgoing_inflight_upper_limit(IN_FLIGHT);
    let (topic, message) = options.will.clone();
    mqtt.set_last_will(LastWill::new(topic, message, QoS::AtLeastOnce, false, None));
    if let Some((name, Password(password))) = &options.login {
        mqtt.set_credentials(name, password);
    }
    if let Some(transport) = transport(options) {
        mqtt.set_transport(transport);
    }
    AsyncClient::new(mqtt, MAX_UNSENT)
}

/// Returns the transport to the broker, if it is not plain TCP.
fn transport(options: &Options) -> Option<Transport> {
    let tls = options.tls.as_ref().map(|Tls { authorities, client }| {
        let client_auth = client.clone().map(|(certificate, key)| (certificate, key.0.into_bytes()));
        TlsConfiguration::Simple { ca: authorities.clone(), alpn: None, client_auth }
    });
    match (tls, &options.url) {
        (tls, None) => tls.map(Transport::Tls),
        #[cfg(feature = "websocket")]
        (None, Some(_)) => Some(Transport::Ws),
        #[cfg(feature = "websocket")]
        (Some(tls), Some(_)) => Some(Transport::Wss(tls)),
        #[cfg(not(feature = "websocket"))]
        (_, Some(_)) => None, // the site file was refused
    }
}

impl Options {
    fn place(&self) -> &str {
        self.url.as_deref().unwrap_or(&self.host)
    }
}

/// Checks that a text has certificates in PEM form, as [`Tls`] takes them.
///
/// # Errors
/// If there is no certificate, or if one cannot be read.
pub fn check_certificates(text: &str) -> Result<()> {
    let mut certificates = CertificateDer::pem_slice_iter(text.as_bytes()).peekable();
    ensure!(certificates.peek().is_some(), "no BEGIN CERTIFICATE in PEM format");
    certificates
        .try_for_each(|certificate| certificate.map(drop))
        .context("a certificate is not in PEM format")
}

impl fmt::Debug for Password {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Password")
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Called when the next message was handed over. With a number the message is in flight; without one (QoS 0) it is
/// published, and its token returned.
fn hand_over(
    sent: &Mutex<VecDeque<Option<u64>>>,
    number: u16,
    flight: &mut HashMap<u16, u64>,
) -> Option<u64> {
    let token = lock(sent).pop_front().flatten()?;
    if number == 0 {
        return Some(token);
    }
    flight.insert(number, token);
    None
}

async fn run(mut connection: EventLoop, sent: &Mutex<VecDeque<Option<u64>>>, report: impl Fn(BrokerEvent)) {
    let mut flight: HashMap<u16, u64> = HashMap::new();
    let why = loop {
        let event = match connection.poll().await {
            Ok(event) => event,
            Err(ConnectionError::RequestsDone) => break "closed".into(),
            Err(error) => {
                match &error {
                    ConnectionError::MqttState(StateError::Deserialization(
                        Malformed::InvalidConnectReturnCode(TOO_LARGE),
                    )) => report(BrokerEvent::TooLong),
                    ConnectionError::MqttState(StateError::ServerDisconnect {
                        reason_code: DisconnectReasonCode::SessionTakenOver,
                        ..
                    }) => report(BrokerEvent::TakenOver),
                    _ => {}
                }
                break explain(&error);
            }
        };
        match event {
            Event::Incoming(Incoming::ConnAck(ack)) => {
                report(BrokerEvent::Connected(
                    ack.properties.and_then(|properties| properties.max_packet_size),
                ));
            }
            Event::Incoming(Incoming::SubAck(ack)) => {
                let granted = |code: &SubscribeReasonCode| matches!(code, SubscribeReasonCode::Success(_));
                match ack.return_codes.iter().find(|code| !granted(code)) {
                    None => report(BrokerEvent::Subscribed),
                    Some(code) => break format!("the broker refuses a subscription: {code:?}"),
                }
            }
            Event::Incoming(Incoming::Publish(message)) => report(BrokerEvent::Message {
                topic: String::from_utf8_lossy(&message.topic).into_owned(),
                payload: message.payload.to_vec(),
                is_retained: message.retain,
            }),
            Event::Outgoing(Outgoing::Publish(number)) => {
                if let Some(token) = hand_over(sent, number, &mut flight) {
                    report(BrokerEvent::Published(token));
                }
            }
            Event::Incoming(Incoming::PubAck(ack)) => {
                let Some(token) = flight.remove(&ack.pkid) else {
                    match ack.reason {
                        PubAckReason::Success | PubAckReason::NoMatchingSubscribers => {}
                        reason => report(BrokerEvent::NotTaken(format!("{reason:?}"))),
                    }
                    continue;
                };
                report(match ack.reason {
                    PubAckReason::Success | PubAckReason::NoMatchingSubscribers => {
                        BrokerEvent::Published(token)
                    }
                    reason => {
                        BrokerEvent::Rejected { token, why: format!("{reason:?}"), refusal: refusal(reason) }
                    }
                });
            }
            _ => {}
        }
    };
    report(BrokerEvent::Closed(why));
}

/// Returns the scope of a refusal with this reason.
fn refusal(reason: PubAckReason) -> Refusal {
    match reason {
        PubAckReason::NotAuthorized | PubAckReason::TopicNameInvalid => Refusal::Topic,
        PubAckReason::PayloadFormatInvalid => Refusal::Message,
        PubAckReason::UnspecifiedError
        | PubAckReason::ImplementationSpecificError
        | PubAckReason::PacketIdentifierInUse
        | PubAckReason::QuotaExceeded
        | PubAckReason::Success
        | PubAckReason::NoMatchingSubscribers => Refusal::Passing,
    }
}

/// Faults of a broker's certificate, as rustls names them, with advice for each.
const CERTIFICATES: [(&str, &str); 5] = [
    (
        "CaUsedAsEndEntity",
        "the broker's certificate is that of an authority, such as a self-signed one: make a certificate signed by it, see \"Certificates\" in docs/bridge.md",
    ),
    (
        "UnsupportedCertVersion",
        "the broker's certificate has version 1 without names: make one of version 3 with subjectAltName, see \
         \"Certificates\" in docs/bridge.md",
    ),
    (
        "UnknownIssuer",
        "the broker's certificate is self-signed, or not signed by tls.ca: see \
         \"Certificates\" in docs/bridge.md",
    ),
    ("Expired", "the broker's certificate has expired, or this machine's clock is wrong"),
    ("NotValidForName", "the broker's certificate does not have the name in address"),
];

fn certificate_advice(error: &str) -> String {
    let advice = CERTIFICATES.iter().find(|(found, _)| error.contains(found));
    format!("TLS: {error}: {}", advice.map_or("see address and tls, and the broker's certificate", |it| it.1))
}

/// Describes an error of the connection, with advice.
fn explain(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(code) => {
            format!(
                "the broker refuses the connection: {code:?}: check user, password_file and the broker's access control"
            )
        }
        ConnectionError::Tls(error) => certificate_advice(&error.to_string()),
        ConnectionError::Timeout(_) => "the broker does not answer".into(),
        ConnectionError::MqttState(StateError::Deserialization(Malformed::InvalidConnectReturnCode(
            TOO_LARGE,
        ))) => "the message is too long for the broker: see its message size limit".into(),
        ConnectionError::MqttState(StateError::Deserialization(Malformed::OutgoingPacketTooLarge {
            pkt_size,
            max,
        })) => {
            format!("a birth of {pkt_size} bytes exceeds the broker's packet limit of {max}")
        }
        ConnectionError::MqttState(StateError::ServerDisconnect { reason_code, .. }) => {
            format!("the broker ends the connection: {reason_code:?}")
        }
        error => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use rumqttc::v5::mqttbytes::v5::Publish;

    use super::*;

    #[test]
    fn a_packet_has_the_length_that_is_sent() {
        for length in
            [0, 100, 119, 120, 121, 122, 123, 16_370, 16_376, 16_377, 16_378, 16_379, 2_097_142, 2_097_143]
        {
            let payload = vec![0; length];
            for (qos, number) in [(QoS::AtMostOnce, 0), (QoS::AtLeastOnce, 7)] {
                let packet = Publish { pkid: number, ..Publish::new("t/é", qos, payload.clone(), None) };
                assert_eq!(Session::packet_len("t/é", &payload, number > 0), packet.size(), "{length}");
            }
        }
    }
}
