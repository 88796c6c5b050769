//! What a viewer can set: how quick it goes, and the weights of the shapes.

use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use foxglove::WebSocketServerHandle;
use foxglove::websocket::{
    AnyClient, GetParametersResponder, Parameter, ParameterHandler, ParameterValue,
    SetParametersResponder,
};

/// How many times as quick.
pub(super) const SPEED: &str = "speed";
/// Whether the weights are the take's.
pub(super) const FOLLOW_TAKE: &str = "follow_take";
/// Before the name of a shape.
const WEIGHT: &str = "weights.";
/// Quickest that can be asked for.
const QUICKEST: f64 = 100.0;

/// Something that a viewer set.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Change {
    /// How many times as quick; 0 pauses.
    Speed(f64),
    /// All weights are the take's again, or stay where they are.
    FollowTake(bool),
    /// The weight of a shape, by its index.
    Weight(usize, f32),
}

/// What a parameter of this name and value changes, and the value that it has then; `None` where
/// there is no such parameter, or no such value of it.
fn change_of(
    known: &[Parameter],
    name: &str,
    value: &ParameterValue,
) -> Option<(Change, Parameter)> {
    known.iter().find(|p| p.name == name)?;
    let number = match value {
        ParameterValue::Integer(value) => Some(*value as f64),
        ParameterValue::Float64(value) => Some(*value),
        _ => None,
    };
    let number = number.filter(|n| n.is_finite());
    Some(match (name, value) {
        (SPEED, _) => {
            let speed = number?.clamp(0.0, QUICKEST);
            (Change::Speed(speed), Parameter::float64(name, speed))
        }
        (FOLLOW_TAKE, ParameterValue::Bool(follows)) => (
            Change::FollowTake(*follows),
            Parameter::bool(name, *follows),
        ),
        _ => {
            let weights = known.iter().filter(|p| p.name.starts_with(WEIGHT));
            let shape = weights.map(|p| p.name.as_str()).position(|p| p == name)?;
            let weight = number?.clamp(0.0, 1.0);
            let change = Change::Weight(shape, weight as f32);
            (change, Parameter::float64(name, weight))
        }
    })
}

/// The parameters as viewers see them.
pub(super) struct Parameters {
    known: Mutex<Vec<Parameter>>,
    changes: Mutex<Sender<Change>>,
    /// To tell the other viewers; there once the server runs.
    server: OnceLock<Weak<WebSocketServerHandle>>,
}

impl Parameters {
    /// - `weights`: names of the shapes, none for a recording
    pub(super) fn new(
        speed: f64,
        weights: &[String],
        follows_take: Option<bool>,
        changes: Sender<Change>,
    ) -> Self {
        let mut known = vec![Parameter::float64(SPEED, speed)];
        known.extend(follows_take.map(|follows| Parameter::bool(FOLLOW_TAKE, follows)));
        let weights = weights.iter();
        known.extend(weights.map(|name| Parameter::float64(format!("{WEIGHT}{name}"), 0.0)));
        Self {
            known: Mutex::new(known),
            changes: Mutex::new(changes),
            server: OnceLock::new(),
        }
    }

    /// Tells viewers through this server from now on.
    pub(super) fn tell(&self, server: &Arc<WebSocketServerHandle>) {
        // Set once, where the server is started.
        let _ = self.server.set(Arc::downgrade(server));
    }
}

impl ParameterHandler for Parameters {
    fn get(
        &self,
        _client: AnyClient,
        names: Vec<String>,
        _request_id: Option<String>,
        responder: GetParametersResponder,
    ) {
        let known = lock(&self.known);
        let asked = known
            .iter()
            .filter(|p| names.is_empty() || names.contains(&p.name));
        responder.respond(asked.cloned().collect());
    }

    fn set(
        &self,
        _client: AnyClient,
        parameters: Vec<Parameter>,
        _request_id: Option<String>,
        responder: SetParametersResponder,
    ) {
        let mut known = lock(&self.known);
        let mut now = Vec::new();
        for parameter in parameters {
            let changed = parameter.value.as_ref();
            let changed = changed.and_then(|value| change_of(&known, &parameter.name, value));
            if let Some((change, value)) = changed {
                // A player that has ended takes no more.
                let _ = lock(&self.changes).send(change);
                if let Some(own) = known.iter_mut().find(|p| p.name == value.name) {
                    *own = value;
                }
            }
            // What could not be set is answered with what it still is.
            now.extend(known.iter().find(|p| p.name == parameter.name).cloned());
        }
        drop(known);
        if let Some(server) = self.server.get().and_then(Weak::upgrade) {
            server.publish_parameter_values(now.clone());
        }
        responder.respond(now);
    }
}

/// What a panic elsewhere left is still whole: values are replaced in one piece.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_checked_and_brought_into_range() {
        let (sender, _receiver) = std::sync::mpsc::channel();
        let names = ["jawOpen".to_owned(), "mouthClose".to_owned()];
        let parameters = Parameters::new(1.0, &names, Some(true), sender);
        let known = lock(&parameters.known).clone();
        let change = |name: &str, value: ParameterValue| {
            change_of(&known, name, &value).map(|(change, _)| change)
        };
        assert_eq!(
            change("weights.mouthClose", ParameterValue::Float64(0.5)),
            Some(Change::Weight(1, 0.5))
        );
        assert_eq!(
            change("weights.jawOpen", ParameterValue::Integer(3)),
            Some(Change::Weight(0, 1.0))
        );
        assert_eq!(
            change(SPEED, ParameterValue::Float64(-1.0)),
            Some(Change::Speed(0.0))
        );
        assert_eq!(
            change(FOLLOW_TAKE, ParameterValue::Bool(false)),
            Some(Change::FollowTake(false))
        );
        for (name, value) in [
            ("weights.jaw", ParameterValue::Float64(0.5)),
            ("weights.jawOpen", ParameterValue::Float64(f64::NAN)),
            ("weights.jawOpen", ParameterValue::Bool(true)),
            (SPEED, ParameterValue::String("2".to_owned())),
            (FOLLOW_TAKE, ParameterValue::Integer(1)),
        ] {
            assert_eq!(change(name, value.clone()), None, "{name} {value:?}");
        }
    }
}
