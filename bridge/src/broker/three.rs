//! A connection with MQTT 3.1.1, which has no reasons: what the broker does not take it acknowledges, or ends the connection.

use std::collections::{HashMap, VecDeque};
use std::sync::Mutex;

use rumqttc::mqttbytes::v4::{LastWill, SubscribeReasonCode};
use rumqttc::{
    AsyncClient, ConnectionError, Event, EventLoop, Incoming, MqttOptions, Outgoing, QoS, SubscribeFilter,
};

use super::{
    Happened, IN_FLIGHT, LONGEST, Options, Password, ROOM, certificate_advice, hand_over, transport,
};

pub(super) fn open(options: &Options) -> (AsyncClient, EventLoop) {
    let mut mqtt = MqttOptions::new(&options.client, options.place(), options.port);
    mqtt.set_clean_session(true);
    mqtt.set_keep_alive(options.keep_alive);
    mqtt.set_max_packet_size(LONGEST as usize, LONGEST as usize);
    mqtt.set_inflight(IN_FLIGHT);
    let (topic, message) = options.will.clone();
    mqtt.set_last_will(LastWill::new(topic, message, QoS::AtLeastOnce, false));
    if let Some((name, Password(password))) = &options.login {
        mqtt.set_credentials(name, password);
    }
    if let Some(transport) = transport(options) {
        mqtt.set_transport(transport);
    }
    AsyncClient::new(mqtt, ROOM)
}

pub(super) fn subscribe<'a>(client: &AsyncClient, topics: impl Iterator<Item = &'a String>) {
    let filters = topics.map(|topic| SubscribeFilter::new(topic.clone(), QoS::AtLeastOnce));
    // A connection that has ended has reported it.
    let _ = client.try_subscribe_many(filters);
}

pub(super) async fn run(
    mut connection: EventLoop,
    sent: &Mutex<VecDeque<Option<u64>>>,
    report: impl Fn(Happened),
) {
    let mut flight: HashMap<u16, u64> = HashMap::new();
    let why = loop {
        let event = match connection.poll().await {
            Ok(event) => event,
            Err(ConnectionError::RequestsDone) => break "closed".into(),
            Err(error) => break explain(&error),
        };
        match event {
            Event::Incoming(Incoming::ConnAck(_)) => report(Happened::Connected(None)),
            Event::Incoming(Incoming::SubAck(ack)) => {
                match ack.return_codes.contains(&SubscribeReasonCode::Failure) {
                    false => report(Happened::Subscribed),
                    true => break "the broker refuses a subscription".into(),
                }
            }
            Event::Incoming(Incoming::Publish(message)) => report(Happened::Message {
                topic: message.topic,
                payload: message.payload.to_vec(),
                is_retained: message.retain,
            }),
            Event::Outgoing(Outgoing::Publish(number)) => {
                if let Some(token) = hand_over(sent, number, &mut flight) {
                    report(Happened::Published(token));
                }
            }
            Event::Incoming(Incoming::PubAck(ack)) => {
                if let Some(token) = flight.remove(&ack.pkid) {
                    report(Happened::Published(token));
                }
            }
            _ => {}
        }
    };
    report(Happened::Closed(why));
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
