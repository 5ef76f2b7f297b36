//! JSON-RPC 2.0: one call a body, handed to the main world.

use std::{
    sync::{
        PoisonError,
        mpsc::{RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use serde_json::{Map, Value, json};

use super::{
    Answer, Call, Gate,
    error::{CallError, HttpRefusal},
    http::end_of,
    schema::{self, DISCOVER},
};
use crate::rig::nearest::did_you_mean;

/// Time between two attempts to wake an app that sleeps.
const WAKE: Duration = Duration::from_millis(20);

/// Answer to the body of a request.
pub(super) fn answer(body: &[u8], gate: &Gate, calls: &Sender<Call>) -> Value {
    let mut id = Value::Null;
    match result(body, gate, calls, &mut id) {
        Ok(result) => json!({"jsonrpc": "2.0", "id": id, "result": result}),
        Err(error) => failure(id, error.code(), &error.to_string()),
    }
}

/// Answer to a request that is not looked at.
pub(super) fn refused(refusal: HttpRefusal) -> Value {
    failure(Value::Null, -32600, &refusal.to_string())
}

fn failure(id: Value, code: i64, message: &str) -> Value {
    json!({"jsonrpc": "2.0", "id": id, "error": {"code": code, "message": message}})
}

fn result(body: &[u8], gate: &Gate, calls: &Sender<Call>, id: &mut Value) -> Answer {
    let call: Value = serde_json::from_slice(body).map_err(CallError::NotJson)?;
    let Value::Object(mut call) = call else { return Err(CallError::NotACall("it is no object")) };
    match call.remove("id") {
        Some(given @ (Value::Number(_) | Value::String(_))) => *id = given,
        None | Some(Value::Null) => {}
        Some(_) => return Err(CallError::NotACall("`id` is neither a number nor a text")),
    }
    if call.get("jsonrpc") != Some(&Value::from("2.0")) {
        return Err(CallError::NotACall("`jsonrpc` is not \"2.0\""));
    }
    let Some(Value::String(method)) = call.remove("method") else {
        return Err(CallError::NotACall("`method` is no text"));
    };
    let params = match call.remove("params") {
        None | Some(Value::Null) => Value::Object(Map::new()),
        Some(params @ Value::Object(_)) => params,
        Some(_) => return Err(CallError::NotACall("`params` is no object")),
    };
    if method == DISCOVER {
        return Ok(schema::document(gate.address));
    }
    let Some(verb) = schema::verb(&method) else {
        let hint = did_you_mean(&method, schema::names());
        return Err(CallError::UnknownMethod { name: method, hint });
    };
    // Answers are told by what happens to the rig of a call, so there is one call at a time.
    let _turn = gate.turn.lock().unwrap_or_else(PoisonError::into_inner);
    let (reply, answer) = channel();
    let until = end_of(gate.answer_timeout);
    calls.send(Call { verb, params, reply, until }).map_err(|_| CallError::Ended)?;
    loop {
        if let Some(wake) = &*gate.wake.lock().unwrap_or_else(PoisonError::into_inner) {
            wake();
        }
        let left = until.saturating_duration_since(Instant::now());
        match answer.recv_timeout(left.min(WAKE)) {
            Ok(answer) => return answer,
            Err(RecvTimeoutError::Timeout) if left.is_zero() => return Err(CallError::Timeout),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(CallError::Ended),
        }
    }
}
