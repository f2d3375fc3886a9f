//! A connection with MQTT 3.1.1, which has no reasons: the broker acknowledges a message that it does not take, or ends the
//! connection.

use std::collections::{HashMap, VecDeque};
use std::sync::Mutex;

use rumqttc::mqttbytes::v4::{LastWill, SubscribeReasonCode};
use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, Incoming, MqttOptions, Outgoing, QoS, SubscribeFilter,
};

use super::{
    BrokerEvent, IN_FLIGHT, MAX_PACKET_LEN, MAX_UNSENT, Options, Password, certificate_advice, hand_over,
    transport,
};

/// The longest packet of the protocol, in bytes.
const MQTT_MAX_PACKET_LEN: usize = 268_435_460;

pub(super) fn open(options: &Options) -> (AsyncClient, EventLoop) {
    let mut mqtt = MqttOptions::new(&options.client, options.place(), options.port);
    mqtt.set_clean_session(true);
    mqtt.set_keep_alive(options.keep_alive);
    // This version cannot announce a limit, and a longer packet would end each connection. So each is read, and a long one
    // is dropped.
    mqtt.set_max_packet_size(MQTT_MAX_PACKET_LEN, MAX_PACKET_LEN as usize);
    mqtt.set_inflight(IN_FLIGHT);
    let (topic, message) = options.will.clone();
    mqtt.set_last_will(LastWill::new(topic, message, QoS::AtLeastOnce, false));
    if let Some((name, Password(password))) = &options.login {
        mqtt.set_credentials(name, password);
    }
    if let Some(transport) = transport(options) {
        mqtt.set_transport(transport);
    }
    AsyncClient::new(mqtt, MAX_UNSENT)
}

pub(super) fn subscribe<'a>(client: &AsyncClient, topics: impl Iterator<Item = &'a String>) {
    let filters = topics.map(|topic| SubscribeFilter::new(topic.clone(), QoS::AtLeastOnce));
    // A connection that has ended has reported it.
    let _ = client.try_subscribe_many(filters);
}

pub(super) async fn run(
    mut connection: EventLoop,
    sent: &Mutex<VecDeque<Option<u64>>>,
    report: impl Fn(BrokerEvent),
) {
    let mut flight: HashMap<u16, u64> = HashMap::new();
    let why = loop {
        let event = match connection.poll().await {
            Ok(event) => event,
            Err(ConnectionError::RequestsDone) => break "closed".into(),
            Err(error) => break explain(&error),
        };
        match event {
            Event::Incoming(Incoming::ConnAck(_)) => report(BrokerEvent::Connected(None)),
            Event::Incoming(Incoming::SubAck(ack)) => {
                match ack.return_codes.contains(&SubscribeReasonCode::Failure) {
                    false => report(BrokerEvent::Subscribed),
                    true => break "the broker refuses a subscription".into(),
                }
            }
            Event::Incoming(Incoming::Publish(message))
                if message.payload.len() > MAX_PACKET_LEN as usize =>
            {
                report(BrokerEvent::Skipped { topic: message.topic, length: message.payload.len() });
            }
            Event::Incoming(Incoming::Publish(message)) => report(BrokerEvent::Message {
                topic: message.topic,
                payload: message.payload.to_vec(),
                is_retained: message.retain,
            }),
            Event::Outgoing(Outgoing::Publish(number)) => {
                if let Some(token) = hand_over(sent, number, &mut flight) {
                    report(BrokerEvent::Published(token));
                }
            }
            Event::Incoming(Incoming::PubAck(ack)) => {
                if let Some(token) = flight.remove(&ack.pkid) {
                    report(BrokerEvent::Published(token));
                }
            }
            _ => {}
        }
    };
    report(BrokerEvent::Closed(why));
}

fn explain(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(code) => {
            format!(
                "the broker refuses the connection: {code:?}: check user, password_file and the broker's access control"
            )
        }
        ConnectionError::Tls(error) => certificate_advice(&error.to_string()),
        ConnectionError::NetworkTimeout | ConnectionError::FlushTimeout => {
            "the broker does not answer".into()
        }
        error => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpListener;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    use super::super::{Session, Version};
    use super::*;

    #[test]
    fn a_message_longer_than_16_mib_is_dropped_and_the_next_one_is_read() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let options = Options {
            host: "127.0.0.1".into(),
            port: listener.local_addr().unwrap().port(),
            url: None,
            client: "c".into(),
            login: None,
            tls: None,
            version: Version::Three,
            keep_alive: Duration::from_secs(15),
            will: ("w".into(), Vec::new()),
        };
        let (sender, happened) = channel();
        let _session = Session::open(&options, move |it| drop(sender.send(it))).unwrap();
        let (mut peer, _) = listener.accept().unwrap();
        peer.read_exact(&mut [0; 20]).unwrap();
        peer.write_all(&[0x20, 2, 0, 0]).unwrap();
        // PUBLISH with QoS 0 and the topic `t`; its length is a number of base 128.
        let length = (17_usize << 20) + 3;
        let digits = [length | 0x80, length >> 7 | 0x80, length >> 14 | 0x80, length >> 21];
        peer.write_all(&[0x30]).unwrap();
        peer.write_all(&digits.map(|digit| digit.to_le_bytes()[0])).unwrap();
        peer.write_all(&[0, 1, b't']).unwrap();
        peer.write_all(&vec![0; 17 << 20]).unwrap();
        peer.write_all(&[0x30, 5, 0, 1, b't', b'o', b'k']).unwrap();
        let next = || happened.recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!(next(), BrokerEvent::Connected(None));
        assert_eq!(next(), BrokerEvent::Skipped { topic: "t".into(), length: 17 << 20 });
        let message = BrokerEvent::Message { topic: "t".into(), payload: b"ok".to_vec(), is_retained: false };
        assert_eq!(next(), message);
    }
}
