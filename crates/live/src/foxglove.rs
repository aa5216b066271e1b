//! A client of the Foxglove WebSocket protocol, `foxglove.sdk.v1`.
//!
//! The crate `foxglove` has the messages of the protocol. Its own server is not used: it opens a port
//! of its own, without the checks of [`crate::auth`].

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;

use ::foxglove::ws_protocol::client::{ClientMessage, PlaybackCommand, ServiceCallRequest};
use ::foxglove::ws_protocol::parameter::Parameter;
use ::foxglove::ws_protocol::schema::Schema;
use ::foxglove::ws_protocol::server::playback_state::PlaybackStatus;
use ::foxglove::ws_protocol::server::server_info::Capability;
use ::foxglove::ws_protocol::server::{
    Advertise, AdvertiseServices, Channel, MessageData, ParameterValues, PlaybackState, ServerInfo,
    ServiceCallFailure, ServiceCallResponse, Status, Unadvertise, advertise_services,
};
use ::foxglove::ws_protocol::{BinaryMessage, JsonMessage};
use axum::extract::ws::{Message, WebSocket};
use sample::LogTime;
use serde_json::{Value, json};
use store::ChannelInfo;
use tokio::time::interval;

use crate::auth::Permission;
use crate::hub::{Subscriber, Topics};
use crate::server::Shared;

/// Subprotocol of the connections.
pub const SUBPROTOCOL: &str = "foxglove.sdk.v1";
/// Number and name of the service for marks.
const MARK_SERVICE: u32 = 1;
const MARK_NAME: &str = "/mark";
/// Period of pings, by which a dead connection is noticed.
const PING: Duration = Duration::from_secs(10);
/// Prefix of the parameters' names.
const PARAMETERS: &str = "configuration";

/// Serves one client until it leaves.
pub async fn serve(mut socket: WebSocket, shared: Arc<Shared>, permission: Permission) {
    let mut client = Client {
        subscriber: shared.hub.subscribe(),
        shared,
        permission,
        advertised: BTreeMap::new(),
        subscriptions: HashMap::new(),
        playback_changes: 0,
    };
    // Errors mean that the client has left.
    let _ = client.run(&mut socket).await;
}

struct Client {
    subscriber: Subscriber,
    shared: Arc<Shared>,
    permission: Permission,
    advertised: BTreeMap<u64, Arc<ChannelInfo>>,
    /// Channel of each subscription of the client.
    subscriptions: HashMap<u32, u64>,
    playback_changes: u64,
}

type Result<T> = std::result::Result<T, axum::Error>;

impl Client {
    async fn run(&mut self, socket: &mut WebSocket) -> Result<()> {
        socket.send(text(&self.server_info())).await?;
        if self.permission == Permission::Write && self.shared.playback.is_none() {
            socket.send(text(&services())).await?;
        }
        self.advertise(socket).await?;
        let mut ping = interval(PING);
        let mut playback = interval(Duration::from_millis(200));
        loop {
            tokio::select! {
                received = socket.recv() => match received {
                    Some(message) => self.receive(message?, socket).await?,
                    None => return Ok(()),
                },
                () = self.subscriber.changed() => {
                    self.advertise(socket).await?;
                    self.forward(socket).await?;
                }
                _ = ping.tick() => socket.send(Message::Ping(Vec::new().into())).await?,
                _ = playback.tick(), if self.shared.playback.is_some() => {
                    self.report_playback(None, false, socket).await?;
                }
            }
        }
    }

    fn server_info(&self) -> ServerInfo {
        let mut capabilities = vec![Capability::Parameters];
        if self.permission == Permission::Write {
            capabilities.push(Capability::Services);
        }
        let mut info = ServerInfo::new("atvrec");
        if let Some(playback) = &self.shared.playback {
            let [first, last] = playback.state().range;
            capabilities.push(Capability::PlaybackControl);
            info = info.with_playback_time_range(Some((first.0, last.0)));
        }
        info.with_capabilities(capabilities)
            .with_supported_encodings(["json"])
    }

    /// Announces new channels and withdraws those that have ended.
    async fn advertise(&mut self, socket: &mut WebSocket) -> Result<()> {
        let channels = self.shared.hub.channels();
        let ended = self.advertised.keys();
        let ended: Vec<u64> = ended
            .filter(|n| !channels.contains_key(n))
            .copied()
            .collect();
        if !ended.is_empty() {
            self.subscriptions
                .retain(|_, channel| !ended.contains(channel));
            socket.send(text(&Unadvertise::new(ended))).await?;
        }
        let known = &self.advertised;
        let new = channels.iter().filter(|(n, _)| !known.contains_key(n));
        let new: Vec<Channel<'_>> = new.filter_map(|(n, info)| channel(*n, info)).collect();
        if !new.is_empty() {
            socket.send(text(&Advertise::new(new))).await?;
        }
        self.advertised = channels;
        Ok(())
    }

    async fn forward(&mut self, socket: &mut WebSocket) -> Result<()> {
        for received in self.subscriber.take() {
            for (subscription, channel) in &self.subscriptions {
                if *channel == received.channel {
                    let time = received.message.log_time.0;
                    let message = MessageData::new(*subscription, time, &*received.message.data);
                    let bytes = message.to_bytes();
                    socket.send(Message::Binary(bytes.into())).await?;
                }
            }
        }
        Ok(())
    }

    async fn receive(&mut self, message: Message, socket: &mut WebSocket) -> Result<()> {
        let parsed = match &message {
            Message::Text(text) => ClientMessage::parse_json(text),
            Message::Binary(bytes) => ClientMessage::parse_binary(bytes),
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) => return Ok(()),
        };
        match parsed {
            Ok(ClientMessage::Subscribe(request)) => {
                for subscription in request.subscriptions {
                    let channel = subscription.channel_id;
                    self.subscriptions.insert(subscription.id, channel);
                }
                self.want();
            }
            Ok(ClientMessage::Unsubscribe(request)) => {
                for id in request.subscription_ids {
                    self.subscriptions.remove(&id);
                }
                self.want();
            }
            Ok(ClientMessage::GetParameters(request)) => {
                let values = self.parameters(&request.parameter_names);
                let values = match request.id {
                    Some(id) => values.with_id(id),
                    None => values,
                };
                socket.send(text(&values)).await?;
            }
            Ok(ClientMessage::SetParameters(request)) => {
                let names = request.parameters.into_iter().map(|p| p.name);
                let names: Vec<String> = names.collect();
                socket.send(status("parameters are read-only")).await?;
                socket.send(text(&self.parameters(&names))).await?;
            }
            Ok(ClientMessage::SubscribeParameterUpdates(request)) => {
                let values = self.parameters(&request.parameter_names);
                socket.send(text(&values)).await?;
            }
            Ok(ClientMessage::ServiceCallRequest(request)) => {
                let answer = self.call(&request).await;
                socket.send(answer).await?;
            }
            Ok(ClientMessage::PlaybackControlRequest(request)) => {
                let Some(playback) = &self.shared.playback else {
                    return Ok(());
                };
                let plays = request.playback_command == PlaybackCommand::Play;
                let seek = request.seek_time.map(LogTime);
                playback.set(plays, Some(request.playback_speed.into()), seek);
                let id = Some(request.request_id);
                self.report_playback(id, seek.is_some(), socket).await?;
            }
            Ok(_) => {}
            Err(error) => {
                let text = format!("the message is not valid: {error}");
                socket.send(status(&text)).await?;
            }
        }
        Ok(())
    }

    /// Tells the hub which topics the client subscribes to.
    fn want(&self) {
        let channels = self.subscriptions.values();
        let infos = channels.filter_map(|channel| self.advertised.get(channel));
        let topics: Topics = infos.map(|info| info.topic.clone()).collect();
        self.subscriber.want(topics);
    }

    /// Values of the named parameters, or of all.
    fn parameters(&self, names: &[String]) -> ParameterValues {
        let hello = self.shared.hub.source().hello;
        let of = |key: &str| hello[key].as_str().map(str::to_owned);
        let all = [
            ("vehicle", of("vehicle")),
            ("version", of("version")),
            (PARAMETERS, of("configuration")),
        ];
        let wanted = |name: &str| names.is_empty() || names.iter().any(|known| known == name);
        let known = all.into_iter().filter(|(name, _)| wanted(name));
        ParameterValues::new(
            known.filter_map(|(name, value)| Some(Parameter::string(name, value?))),
        )
    }

    async fn call(&self, request: &ServiceCallRequest<'_>) -> Message {
        let failed = |message: &str| {
            text(&ServiceCallFailure {
                service_id: request.service_id,
                call_id: request.call_id,
                message: message.to_owned(),
            })
        };
        if self.permission != Permission::Write {
            return failed("marks need the token: connect with ?token=TOKEN behind the address");
        }
        if request.service_id != MARK_SERVICE {
            return failed("there is no such service");
        }
        let Ok(body) = serde_json::from_slice::<Value>(&request.payload) else {
            return failed("the request is not JSON such as {\"text\": \"gravel\"}");
        };
        let text = body["text"].as_str().unwrap_or_default();
        match self.shared.control.mark(text).await {
            Ok(answer) => {
                let payload = json!({ "time_ns": answer["time_ns"] }).to_string();
                let response = ServiceCallResponse {
                    service_id: request.service_id,
                    call_id: request.call_id,
                    encoding: "json".into(),
                    payload: payload.into_bytes().into(),
                };
                Message::Binary(response.to_bytes().into())
            }
            Err(error) => failed(&error),
        }
    }

    async fn report_playback(
        &mut self,
        request_id: Option<String>,
        did_seek: bool,
        socket: &mut WebSocket,
    ) -> Result<()> {
        let Some(playback) = &self.shared.playback else {
            return Ok(());
        };
        let state = playback.state();
        if request_id.is_none() && state.changes == self.playback_changes {
            return Ok(());
        }
        self.playback_changes = state.changes;
        let message = PlaybackState {
            status: match (state.has_ended, state.is_playing) {
                (true, _) => PlaybackStatus::Ended,
                (_, true) => PlaybackStatus::Playing,
                (_, false) => PlaybackStatus::Paused,
            },
            current_time: state.time.0,
            playback_speed: state.speed as f32,
            did_seek,
            request_id,
        };
        socket
            .send(Message::Binary(message.to_bytes().into()))
            .await
    }
}

fn channel(number: u64, info: &ChannelInfo) -> Option<Channel<'static>> {
    let schema = Schema::new(info.schema.clone(), "protobuf", info.schema_data.to_vec());
    let channel = Channel::builder(number, info.topic.clone(), "protobuf").with_schema(schema);
    channel
        .with_metadata(info.metadata.clone())
        .build()
        .map(Channel::into_owned)
        .ok()
}

fn services() -> AdvertiseServices<'static> {
    let request = json!({
        "type": "object",
        "properties": { "text": { "type": "string" } },
        "required": ["text"],
    });
    let response = json!({
        "type": "object",
        "properties": { "time_ns": { "type": "integer" } },
    });
    let schema = |name: &'static str, schema: &Value| {
        Schema::new(name, "jsonschema", schema.to_string().into_bytes())
    };
    let service = advertise_services::Service::new(MARK_SERVICE, MARK_NAME, "atvrec.Mark")
        .with_request("json", schema("atvrec.MarkRequest", &request))
        .and_then(|service| {
            service.with_response("json", schema("atvrec.MarkResponse", &response))
        });
    AdvertiseServices::new(service.ok())
}

fn text(message: &impl JsonMessage) -> Message {
    Message::Text(JsonMessage::to_string(message).into())
}

fn status(message: &str) -> Message {
    text(&Status::warning(message))
}
