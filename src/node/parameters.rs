//! The parameters of the running node, as the parameter services of ROS show and change them.
//!
//! Keeps true: what the services show is what the node works with, or is about to; answers are those of rclcpp, but for the
//! reasons, which say more.

mod serve;

use std::cell::{Cell, RefCell};
use std::time::Instant;

use tokio::sync::mpsc::Sender;
use tracing::{debug, info, warn};

pub(super) use self::serve::{Calls, MOST_CALLS, ParameterService, Serves, Setter, Tells, answer_all, serve};
use super::clock;
use super::throttle::{Often, Throttle};
use super::transport::Event;
use crate::args::Setup;
use crate::cloud::CloudFilter;
use crate::config::{self, Bounds, Changed, Config, ConfigError, Current, Value};
use crate::engine::Stamp;
use crate::line::one_line;
use crate::msg::parameters::{
    DescribeResponse, FloatingPointRange, GetResponse, IntegerRange, ListParametersResult, ListRequest,
    ListResponse, Names, Parameter, ParameterDescriptor, ParameterEvent, ParameterValue, SetParametersResult,
    SetRequest, TypesResponse, kind,
};
use crate::msg::topic::{Qos, Topic};

/// Names that one request may have: there are not as many parameters.
const MOST_NAMES: usize = 256;

/// Why one that has more is refused.
const TOO_MANY: &str = "a request may have 256 entries at most: there are not as many parameters";

/// What stands between the parts of a parameter's name.
const SEPARATOR: char = '.';

/// Letters of a reason, about.
const MAX_REASON: usize = 400;

/// Topic of the changes.
pub(super) const EVENTS: Topic =
    Topic::new("/parameter_events", "rcl_interfaces/msg/ParameterEvent", Qos::reliable(1000));

/// The parameters as they are now.
pub(super) struct Parameters {
    /// Fully qualified name of the node.
    node: String,
    current: RefCell<Current>,
    /// Newest simulated time.
    clock: Cell<Option<Stamp>>,
    throttle: RefCell<Throttle>,
    /// What changes were told of.
    told: RefCell<Often>,
}

impl Parameters {
    /// Those that the node starts with.
    pub(super) fn of(setup: &Setup) -> Self {
        Self::new(setup.fully_qualified_name(), setup.parameters.clone())
    }

    fn new(node: String, current: Current) -> Self {
        let current = RefCell::new(current);
        Self { node, current, clock: Cell::new(None), throttle: RefCell::default(), told: RefCell::default() }
    }

    /// What they stand for.
    pub(super) fn config(&self) -> Config {
        self.current.borrow().config().clone()
    }

    /// Those that have other values than these.
    pub(super) fn other_than(&self, before: &Current) -> Vec<(String, Value)> {
        let current = self.current.borrow();
        let is_same = |(name, now): &(&String, &Value)| before.get(name).is_some_and(|(_, was)| was == *now);
        let others = current.values().filter(|pair| !is_same(pair));
        others.map(|(name, value)| (name.clone(), value.clone())).collect()
    }

    /// Which points of a cloud are taken in now.
    pub(super) fn filter(&self) -> CloudFilter {
        self.current.borrow().config().filter
    }

    /// Notes the simulated time, which events of parameters are stamped with.
    pub(super) fn note_clock(&self, stamp: Stamp) {
        self.clock.set(Some(stamp));
    }

    pub(super) fn get(&self, asked: &Names) -> GetResponse {
        GetResponse { values: self.of_each(asked, |_, (_, value)| on_wire(value)) }
    }

    pub(super) fn types(&self, asked: &Names) -> TypesResponse {
        TypesResponse { types: self.of_each(asked, |_, (_, value)| on_wire(value).kind) }
    }

    pub(super) fn describe(&self, asked: &Names) -> DescribeResponse {
        DescribeResponse {
            descriptors: self.of_each(asked, |current, (named, _)| descriptor(current, named)),
        }
    }

    /// Whether a request of so many entries is refused, before anything is done for them.
    fn refuses(&self, entries: usize) -> bool {
        let is_refused = entries > MOST_NAMES;
        if is_refused && self.throttle.borrow_mut().allows(TOO_MANY, Instant::now()) {
            warn!("a request with {entries} entries was refused: {TOO_MANY}");
        }
        is_refused
    }

    /// Something of each parameter; of none where one of them is unknown, as rclcpp has it.
    fn of_each<T>(&self, asked: &Names, of: impl Fn(&Current, (&config::Parameter, &Value)) -> T) -> Vec<T> {
        let current = self.current.borrow();
        if self.refuses(asked.names.len()) {
            return Vec::new();
        }
        let found = asked.names.iter().map(|name| current.get(name).map(|found| of(&current, found)));
        found.collect::<Option<_>>().unwrap_or_default()
    }

    pub(super) fn list(&self, asked: &ListRequest) -> ListResponse {
        let current = self.current.borrow();
        let mut result = ListParametersResult::default();
        if self.refuses(asked.prefixes.len()) {
            return ListResponse { result };
        }
        for name in current.names().filter(|name| is_listed(name, asked)) {
            result.names.push(name.to_owned());
            if let Some((prefix, _)) = name.rsplit_once(SEPARATOR)
                && !result.prefixes.iter().any(|known| known == prefix)
            {
                result.prefixes.push(prefix.to_owned());
            }
        }
        ListResponse { result }
    }

    /// Sets all of these values or none, and says what has changed.
    pub(super) fn set(&self, wanted: SetRequest) -> (SetParametersResult, Option<ParameterEvent>) {
        if self.refuses(wanted.parameters.len()) {
            return (too_many(), None);
        }
        match self.change(wanted) {
            Ok(changed) => {
                (SetParametersResult { successful: true, reason: String::new() }, self.event(changed))
            }
            Err(error) => {
                let reason = shortened(&one_line(&error.to_string()));
                debug!("{reason}");
                (SetParametersResult { successful: false, reason }, None)
            }
        }
    }

    /// Sets all of these values or none, says what has changed, and tells the node of it.
    pub(super) async fn set_and_tell<R>(
        &self,
        wanted: SetRequest,
        events: &Sender<Event<R>>,
    ) -> (SetParametersResult, Option<ParameterEvent>) {
        // A place first: what is stored is carried out, whatever ends this task.
        let place = events.reserve().await;
        let (result, change) = self.set(wanted);
        // Where the node has ended, nobody is left to be told.
        if let (Some(_), Ok(place)) = (&change, place) {
            place.send(Event::Changed(Box::new(self.config())));
        }
        (result, change)
    }

    fn change(&self, wanted: SetRequest) -> Result<Vec<Changed>, ConfigError> {
        let mut current = self.current.borrow_mut();
        let values = wanted.parameters.into_iter().map(|Parameter { name, value }| match from_wire(value) {
            Ok(value) => Ok((name, value)),
            Err(kind) => Err(current.refuse_type(&name, kind)),
        });
        let values = values.collect::<Result<_, _>>()?;
        let changed = current.change(values)?;
        for Changed { name, before, now } in &changed {
            let line = format!("{name} is {now} from now on, it was {before}");
            // Somebody may change it a thousand times a second.
            if self.told.borrow_mut().allows(name, Instant::now()) {
                info!("{line}");
            } else {
                debug!("{line}");
            }
        }
        Ok(changed)
    }

    fn event(&self, changed: Vec<Changed>) -> Option<ParameterEvent> {
        let to_message = |Changed { name, now, .. }| Parameter { name, value: on_wire(&now) };
        let changed_parameters: Vec<_> = changed.into_iter().map(to_message).collect();
        (!changed_parameters.is_empty()).then(|| ParameterEvent {
            stamp: self.now().into(),
            node: self.node.clone(),
            changed_parameters,
            ..ParameterEvent::default()
        })
    }

    /// The time by the node's clock; 0 until `/clock` has told it.
    fn now(&self) -> Stamp {
        if self.current.borrow().config().use_sim_time {
            return self.clock.get().unwrap_or(Stamp::from_nanos(0));
        }
        clock::now()
    }
}

/// The answer to a request that has too many entries.
fn too_many() -> SetParametersResult {
    SetParametersResult { successful: false, reason: TOO_MANY.to_owned() }
}

/// The text with its middle left out where it is long: a value comes from anyone, and is in the reason.
fn shortened(text: &str) -> String {
    let letters = text.chars().count();
    if letters <= MAX_REASON {
        return text.to_owned();
    }
    let (start, end) = (text.chars().take(MAX_REASON / 2), text.chars().skip(letters - MAX_REASON / 2));
    start.chain(" ... ".chars()).chain(end).collect()
}

fn is_listed(name: &str, asked: &ListRequest) -> bool {
    let is_within = |rest: &str| asked.depth == 0 || (rest.matches(SEPARATOR).count() as u64) < asked.depth;
    let below = |prefix: &String| name.strip_prefix(prefix.as_str())?.strip_prefix(SEPARATOR);
    let matches = |prefix: &String| name == prefix || below(prefix).is_some_and(is_within);
    if asked.prefixes.is_empty() { is_within(name) } else { asked.prefixes.iter().any(matches) }
}

fn descriptor(current: &Current, parameter: &config::Parameter) -> ParameterDescriptor {
    let mut descriptor = ParameterDescriptor {
        name: parameter.name.clone(),
        kind: on_wire(&parameter.default()).kind,
        description: parameter.description(),
        additional_constraints: parameter.constraints(),
        read_only: current.why_fixed(parameter).is_some(),
        ..ParameterDescriptor::default()
    };
    match parameter.bounds() {
        Bounds::Integers(from_value, to_value) => {
            descriptor.integer_range.push(IntegerRange { from_value, to_value, step: 0 });
        }
        Bounds::Numbers(from_value, to_value) => {
            descriptor.floating_point_range.push(FloatingPointRange { from_value, to_value, step: 0.0 });
        }
        Bounds::Any | Bounds::OneOf(_) | Bounds::Words(_) => {}
    }
    descriptor
}

fn on_wire(value: &Value) -> ParameterValue {
    let empty = ParameterValue::default();
    match value.clone() {
        Value::Boolean(bool_value) => ParameterValue { kind: kind::BOOL, bool_value, ..empty },
        Value::Integer(integer_value) => ParameterValue { kind: kind::INTEGER, integer_value, ..empty },
        Value::Double(double_value) => ParameterValue { kind: kind::DOUBLE, double_value, ..empty },
        Value::Text(string_value) => ParameterValue { kind: kind::STRING, string_value, ..empty },
        Value::TextList(string_array_value) => {
            ParameterValue { kind: kind::STRING_ARRAY, string_array_value, ..empty }
        }
    }
}

/// The value, or what its type is called where no parameter is of it.
fn from_wire(value: ParameterValue) -> Result<Value, &'static str> {
    match value.kind {
        kind::NOT_SET => Err("removed"),
        kind::BOOL => Ok(Value::Boolean(value.bool_value)),
        kind::INTEGER => Ok(Value::Integer(value.integer_value)),
        kind::DOUBLE => Ok(Value::Double(value.double_value)),
        kind::STRING => Ok(Value::Text(value.string_value)),
        kind::STRING_ARRAY => Ok(Value::TextList(value.string_array_value)),
        5..=8 => Err("a list of bytes, booleans or numbers"),
        _ => Err("of a type that ROS does not have"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(given: &[(&str, Value)]) -> Parameters {
        let given = given.iter().map(|(name, value)| ((*name).to_owned(), value.clone()));
        Parameters::new("/cfodi".to_owned(), Current::new(given).unwrap())
    }

    fn names(names: &[&str]) -> Names {
        Names { names: names.iter().map(|&name| name.to_owned()).collect() }
    }

    fn wanted(values: &[(&str, Value)]) -> SetRequest {
        let parameter =
            |(name, value): &(&str, Value)| Parameter { name: (*name).to_owned(), value: on_wire(value) };
        SetRequest { parameters: values.iter().map(parameter).collect() }
    }

    #[test]
    fn a_change_shows_in_what_is_got_and_is_told_once() {
        let parameters = parameters(&[]);
        let (result, event) = parameters.set(wanted(&[("max_range", Value::Integer(5))]));
        assert!(result.successful && result.reason.is_empty());
        let event = event.unwrap();
        assert_eq!((event.node.as_str(), event.changed_parameters.len()), ("/cfodi", 1));
        assert!(event.stamp.sec > 1_700_000_000);
        assert_eq!(event.changed_parameters[0].value, parameters.get(&names(&["max_range"])).values[0]);
        assert_eq!(parameters.filter().max_range, 5.0);
        assert!(
            parameters.set(wanted(&[("max_range", Value::Double(5.0))])).1.is_none(),
            "nothing has changed"
        );
    }

    #[test]
    fn where_one_name_is_unknown_nothing_is_got() {
        let parameters = parameters(&[]);
        let unknown = names(&["depth", "no_such"]);
        assert!(parameters.get(&unknown).values.is_empty() && parameters.types(&unknown).types.is_empty());
        assert!(parameters.describe(&unknown).descriptors.is_empty());
        assert_eq!(parameters.types(&names(&["depth", "clearing"])).types, [kind::INTEGER, kind::BOOL]);
    }

    #[test]
    fn what_is_described_has_its_range_or_its_words() {
        let parameters = parameters(&[]);
        let asked = names(&["depth", "publish_rate", "optical", "max_voxels"]);
        let described = parameters.describe(&asked).descriptors;
        let range = described[0].integer_range[0];
        assert_eq!((range.from_value, range.to_value, described[0].read_only), (1, 8, true));
        let range = described[1].floating_point_range[0];
        assert_eq!((range.from_value, range.to_value, described[1].read_only), (0.01, 100.0, false));
        assert!(described[1].description.ends_with("[Hz]"));
        assert_eq!(described[2].additional_constraints, "`auto`, `yes` or `no`");
        assert_eq!(
            described[3].additional_constraints,
            "0 = no bound; 0 where mode is `paper`, which forgets nothing"
        );
    }

    #[test]
    fn values_of_foreign_types_are_refused_with_what_the_parameter_must_be() {
        let parameters = parameters(&[]);
        let reason = |name: &str, kind| {
            let value = ParameterValue { kind, ..ParameterValue::default() };
            let parameters_of = vec![Parameter { name: name.to_owned(), value }];
            let (result, event) = parameters.set(SetRequest { parameters: parameters_of });
            assert!(!result.successful && event.is_none());
            result.reason
        };
        assert_eq!(
            reason("depth", 8),
            "depth cannot be a list of bytes, booleans or numbers; it must be an integer"
        );
        assert_eq!(reason("depth", kind::NOT_SET), "depth cannot be removed; it must be an integer");
        assert!(reason("\u{1b}[2J\n", 77).contains("unknown parameter"));
        assert!(!reason("\u{1b}[2J\n", 77).contains('\u{1b}'));
    }

    #[test]
    fn the_reason_is_short_however_long_the_value_is_and_still_says_what_it_must_be() {
        let long = Value::Text("ä".repeat(10_000));
        let reason = parameters(&[]).set(wanted(&[("optical", long)])).0.reason;
        assert!(reason.starts_with("optical is ") && reason.ends_with("it must be `auto`, `yes` or `no`"));
        assert!(reason.len() < 1000, "{}", reason.len());
    }

    #[test]
    fn a_request_with_more_entries_than_there_can_be_parameters_is_refused_whole() {
        let parameters = parameters(&[]);
        let listed = |prefixes: usize| {
            let asked = ListRequest { prefixes: vec!["tf_timeout".to_owned(); prefixes], depth: 0 };
            parameters.list(&asked).result.names.len()
        };
        assert_eq!([MOST_NAMES, MOST_NAMES + 1].map(listed), [1, 0]);
        let got = |asked: usize| parameters.get(&names(&vec!["tf_timeout"; asked])).values.len();
        assert_eq!([MOST_NAMES, MOST_NAMES + 1].map(got), [MOST_NAMES, 0]);
        let mut values = vec![("tf_timeout", Value::Double(0.5)); MOST_NAMES + 1];
        let (result, event) = parameters.set(wanted(&values));
        assert!(!result.successful && result.reason == TOO_MANY && event.is_none());
        assert!(TOO_MANY.contains(&MOST_NAMES.to_string()));
        values.pop();
        assert_ne!(parameters.set(wanted(&values)).0.reason, TOO_MANY);
    }

    #[test]
    fn an_event_has_the_simulated_time_where_the_node_goes_by_it() {
        let parameters = parameters(&[("use_sim_time", Value::Boolean(true))]);
        let stamp = |value| parameters.set(wanted(&[("tf_timeout", Value::Double(value))])).1.unwrap().stamp;
        assert_eq!(stamp(0.1), Stamp::from_nanos(0).into());
        parameters.note_clock(Stamp::from_nanos(7_000_000_009));
        assert_eq!(stamp(0.3), Stamp::from_nanos(7_000_000_009).into());
    }

    #[test]
    fn names_are_listed_by_prefix_and_depth_as_in_rclcpp() {
        let all = ["a", "a.b", "a.b.c", "ab", "x.y"];
        let listed = |prefixes: &[&str], depth| -> Vec<&str> {
            let asked = ListRequest { prefixes: names(prefixes).names, depth };
            all.into_iter().filter(|name| is_listed(name, &asked)).collect()
        };
        assert_eq!(listed(&[], 0), all);
        assert_eq!(listed(&[], 1), ["a", "ab"]);
        assert_eq!(listed(&["a"], 0), ["a", "a.b", "a.b.c"]);
        assert_eq!(listed(&["a"], 1), ["a", "a.b"]);
        assert_eq!(listed(&["x", "ab"], 0), ["ab", "x.y"]);
    }
}
