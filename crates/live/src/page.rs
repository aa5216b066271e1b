//! Data of the page: JSON on a websocket, 20 times a second.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use sample::{ForceFrame, Limits, LogTime, Motion, Parameters, PerWheel, Rollover, Terrain};
use serde::Deserialize;
use serde_json::{Value, json};
use store::{ChannelInfo, Record, RowDecoder, Stage};
use tokio::time::{MissedTickBehavior, interval};

use crate::auth::Permission;
use crate::hub::{Received, Subscriber, Topics};
use crate::server::Shared;

/// Period of the values.
const PERIOD: Duration = Duration::from_millis(50);
/// Period of the state of the recorder and of the list of topics.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// Period of pings, by which a dead connection is noticed.
const PING: Duration = Duration::from_secs(10);
/// Topics that every page shows.
const SHOWN: [&str; 9] = [
    "/estimate/motion",
    "/estimate/tyre_forces",
    "/estimate/contact_forces",
    "/estimate/rollover",
    "/estimate/limits",
    "/estimate/terrain",
    "/estimate/parameters",
    "/estimate/events",
    "/tf",
];
/// Time for which parameters are shown; they come once a second, s.
const PARAMETERS_S: f64 = 2.0;
/// Age of limits and of the kind of ground from which they are not shown, s: they come ten times a second.
const LIMITS_S: f64 = 0.5;
/// Most plotted signals of a page, and most values of a signal in one message.
const PLOTS_MAX: usize = 16;
const VALUES_MAX: usize = 100;

/// Message of the page.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Request {
    /// Signals to plot: topic and field.
    Plot(Vec<(String, String)>),
    /// Control of a replay.
    Playback {
        play: bool,
        speed: Option<f64>,
        seek_ns: Option<u64>,
    },
    /// Keeps the connection alive.
    Ping,
}

/// Serves one page until it is closed.
pub async fn serve(mut socket: WebSocket, shared: Arc<Shared>, permission: Permission) {
    let mut page = Page {
        subscriber: shared.hub.subscribe(),
        shared,
        permission,
        parts: Parts::default(),
        plots: Vec::new(),
        decoders: BTreeMap::new(),
        listed: Vec::new(),
    };
    page.want();
    // Errors mean that the page was closed.
    let _ = page.run(&mut socket).await;
}

struct Page {
    subscriber: Subscriber,
    shared: Arc<Shared>,
    permission: Permission,
    parts: Parts,
    plots: Vec<Plot>,
    decoders: BTreeMap<u64, RowDecoder>,
    /// Numbers of the channels whose fields the page knows.
    listed: Vec<u64>,
}

/// Parts of the newest estimate, which come as separate messages.
#[derive(Default)]
struct Parts {
    time: LogTime,
    motion: Option<Motion>,
    carrier: Option<PerWheel<sample::TyreForce>>,
    contact: Option<PerWheel<sample::TyreForce>>,
    rollover: Option<Rollover>,
    parameters: Option<Parameters>,
    limits: Option<Limits>,
    terrain: Option<Terrain>,
    /// East, north and heading of the vehicle.
    place: Option<[f64; 3]>,
    events: Vec<Value>,
}

struct Plot {
    topic: String,
    field: String,
    values: Vec<(f64, f64)>,
}

type Result<T> = std::result::Result<T, axum::Error>;

impl Page {
    async fn run(&mut self, socket: &mut WebSocket) -> Result<()> {
        let mut values = interval(PERIOD);
        values.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut status = interval(STATUS_PERIOD);
        status.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut ping = interval(PING);
        let mut recorder = self.shared.status();
        loop {
            let message = tokio::select! {
                received = socket.recv() => match received {
                    Some(message) => {
                        self.receive(&message?);
                        continue;
                    }
                    None => return Ok(()),
                },
                _ = values.tick() => self.values(),
                _ = status.tick() => {
                    self.list_topics(socket).await?;
                    json!({
                        "status": **recorder.borrow_and_update(),
                        "may_write": self.permission == Permission::Write,
                        "playback": self.playback(),
                    })
                }
                _ = ping.tick() => {
                    socket.send(Message::Ping(Vec::new().into())).await?;
                    continue;
                }
            };
            socket
                .send(Message::Text(message.to_string().into()))
                .await?;
        }
    }

    fn want(&self) {
        let plots = self.plots.iter().map(|plot| plot.topic.clone());
        let topics: Topics = SHOWN.map(str::to_owned).into_iter().chain(plots).collect();
        self.subscriber.want(topics);
    }

    fn receive(&mut self, message: &Message) {
        let Message::Text(text) = message else {
            return;
        };
        match serde_json::from_str(text) {
            Ok(Request::Plot(signals)) => {
                let signals = signals.into_iter().take(PLOTS_MAX);
                let plot = |(topic, field)| Plot {
                    topic,
                    field,
                    values: Vec::new(),
                };
                self.plots = signals.map(plot).collect();
                self.want();
            }
            Ok(Request::Playback {
                play,
                speed,
                seek_ns,
            }) => {
                if let Some(playback) = &self.shared.playback {
                    playback.set(play, speed, seek_ns.map(LogTime));
                }
            }
            Ok(Request::Ping) => {}
            Err(error) => tracing::debug!(%error, "a page sent a message that is not valid"),
        }
    }

    /// Values since the last message.
    fn values(&mut self) -> Value {
        for received in self.subscriber.take() {
            if let Ok(Some(record)) = received.message.record(&received.info) {
                self.parts.take(record);
            }
            self.plot(&received);
        }
        let source = self.shared.hub.source();
        let parts = &mut self.parts;
        let plots: Vec<Value> = self
            .plots
            .iter_mut()
            .map(|plot| {
                let values = std::mem::take(&mut plot.values);
                let skipped = values.len().div_ceil(VALUES_MAX).max(1);
                json!(values.iter().step_by(skipped).collect::<Vec<_>>())
            })
            .collect();
        json!({
            "connected": source.is_connected,
            "now_ns": source.now.map(|now| now.0),
            "lost": source.lost,
            "dropped": self.subscriber.dropped(),
            "vehicle": source.hello["vehicle"],
            "static_load_n": source.hello["static_load_n"],
            "time_ns": parts.time.0,
            "motion": parts.motion,
            "carrier": parts.carrier,
            "contact": parts.contact,
            "rollover": parts.rollover,
            "next_lift": parts.rollover.and_then(|rollover| rollover.next_lift()),
            "parameters": parts.parameters(),
            "limits": parts.limits(),
            "terrain": parts.terrain(),
            "place": parts.place,
            "events": std::mem::take(&mut parts.events),
            "plots": plots,
        })
    }

    fn plot(&mut self, received: &Received) {
        let topic = &received.info.topic;
        if !self.plots.iter().any(|plot| plot.topic == *topic) {
            return;
        }
        let decoder = match self.decoders.entry(received.channel) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                let Ok(decoder) = RowDecoder::new(&received.info) else {
                    return;
                };
                entry.insert(decoder)
            }
        };
        let time_s = received.message.publish_time.0 as f64 / 1e9;
        for (name, value) in decoder.numbers(&received.message.data) {
            let plots = self.plots.iter_mut();
            for plot in plots.filter(|plot| plot.topic == *topic && plot.field == name) {
                plot.values.push((time_s, value));
            }
        }
    }

    /// Sends topics and fields if there are new channels.
    async fn list_topics(&mut self, socket: &mut WebSocket) -> Result<()> {
        let channels = self.shared.hub.channels();
        let numbers: Vec<u64> = channels.keys().copied().collect();
        if numbers == self.listed {
            return Ok(());
        }
        self.listed = numbers;
        self.decoders
            .retain(|number, _| channels.contains_key(number));
        let mut topics: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        for info in channels.values() {
            topics.entry(&info.topic).or_default().extend(fields(info));
        }
        topics.retain(|_, fields| !fields.is_empty());
        let message = json!({ "topics": topics });
        socket.send(Message::Text(message.to_string().into())).await
    }

    fn playback(&self) -> Value {
        let Some(playback) = &self.shared.playback else {
            return Value::Null;
        };
        let state = playback.state();
        json!({
            "first_ns": state.range[0].0,
            "last_ns": state.range[1].0,
            "time_ns": state.time.0,
            "playing": state.is_playing,
            "ended": state.has_ended,
            "speed": state.speed,
        })
    }
}

fn fields(info: &ChannelInfo) -> Vec<String> {
    let decoder = RowDecoder::new(info);
    decoder.map_or_else(|_| Vec::new(), |d| d.numeric().map(str::to_owned).collect())
}

impl Parts {
    /// The parameters, if they belong to the estimate: a replay can have jumped since.
    fn parameters(&self) -> Option<&Parameters> {
        let is_near = |of: &&Parameters| of.time.seconds_since(self.time).abs() < PARAMETERS_S;
        self.parameters.as_ref().filter(is_near)
    }

    /// The limits and the reason of unknown ones, if they belong to the estimate.
    fn limits(&self) -> Value {
        let is_near = |of: &&Limits| of.time.seconds_since(self.time).abs() < LIMITS_S;
        let limits = self.limits.as_ref().filter(is_near);
        limits.map_or(Value::Null, |limits| {
            json!({
                "reason": limits.reason(),
                "lateral_m_s2": limits.lateral_m_s2,
                "speed_m_s": limits.speed_m_s,
                "curve_radius_m": limits.curve_radius_m,
                "curve_speed_m_s": limits.curve_speed_m_s,
                "side_slope_rad": limits.side_slope_rad,
                "grade_rad": limits.grade_rad,
            })
        })
    }

    /// The kind of ground, if it belongs to the estimate.
    fn terrain(&self) -> Option<&Terrain> {
        let is_near = |of: &&Terrain| of.time.seconds_since(self.time).abs() < LIMITS_S;
        self.terrain.as_ref().filter(is_near)
    }

    fn take(&mut self, record: Record) {
        match record {
            Record::Motion {
                time,
                stage: Stage::Estimate,
                motion,
            } => {
                // Not a number is JSON's null; a rollover of an earlier estimate is none of this one.
                if time != self.time {
                    self.rollover = None;
                }
                self.time = time;
                self.motion = Some(*motion);
            }
            Record::TyreForces {
                stage: Stage::Estimate,
                frame,
                forces,
                ..
            } => match frame {
                ForceFrame::WheelCarrier => self.carrier = Some(*forces),
                ForceFrame::Contact => self.contact = Some(*forces),
            },
            Record::Rollover { rollover, .. } => self.rollover = Some(rollover),
            Record::Parameters(parameters) => self.parameters = Some(*parameters),
            Record::Limits(limits) => self.limits = Some(*limits),
            Record::Terrain(terrain) => self.terrain = Some(terrain),
            Record::Event(event) => self.events.push(json!(event)),
            Record::Transforms { transforms, .. } => {
                let mut body = transforms.iter();
                if let Some(body) = body.find(|transform| transform.child == "vehicle") {
                    let [east, north, _] = body.translation_m;
                    let [x, y, z, w] = body.rotation_xyzw;
                    let yaw = math::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
                    self.place = Some([east, north, yaw]);
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_another_position_are_not_shown() {
        let at = LogTime(100_000_000_000);
        let mut parts = Parts::default();
        let motion = |time| Record::Motion {
            time,
            stage: Stage::Estimate,
            motion: Box::default(),
        };
        parts.take(motion(at));
        parts.take(Record::Parameters(Box::new(Parameters {
            time: at,
            ..Parameters::default()
        })));
        parts.take(motion(at.offset_seconds(1.0)));
        assert!(parts.parameters().is_some());
        for jump_s in [30.0, -30.0] {
            parts.take(motion(at.offset_seconds(jump_s)));
            assert!(parts.parameters().is_none(), "{jump_s} s");
        }
    }

    #[test]
    fn the_ground_of_another_position_is_not_shown() {
        let at = LogTime(100_000_000_000);
        let mut parts = Parts::default();
        parts.take(Record::Terrain(Terrain {
            time: at,
            class: sample::TerrainClass::Sand,
            probability: [0.0, 0.0, 0.1, 0.9, 0.0],
            rolling_resistance: f64::NAN,
            rolling_resistance_sigma: f64::NAN,
        }));
        parts.time = at.offset_seconds(0.1);
        let shown = json!(parts.terrain());
        assert_eq!(shown["class"], "sand");
        assert!(shown["rolling_resistance"].is_null(), "{shown}");
        parts.time = at.offset_seconds(-30.0);
        assert!(parts.terrain().is_none());
    }

    #[test]
    fn limits_of_another_position_are_not_shown() {
        let at = LogTime(100_000_000_000);
        let mut parts = Parts::default();
        let mut limits = Limits::unknown(at, sample::LimitsUnknown::Grip);
        limits.grip_used = 0.24;
        parts.take(Record::Limits(Box::new(limits)));
        parts.time = at.offset_seconds(0.1);
        let shown = parts.limits();
        assert_eq!(
            shown["reason"],
            "no more than 0.3 of the grip has been used"
        );
        assert!(shown["lateral_m_s2"]["value"].is_null(), "{shown}");
        parts.time = at.offset_seconds(30.0);
        assert!(parts.limits().is_null());
    }
}
