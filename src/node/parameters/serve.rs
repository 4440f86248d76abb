//! The parameter services: their names and types, and how each is answered, over whatever middleware.

use std::borrow::Cow;
use std::rc::Rc;
use std::time::Instant;

use tokio::sync::mpsc::Sender;
use tracing::warn;

use super::{Parameters, too_many};
use crate::msg::parameters::{
    DescribeResponse, GetResponse, ListRequest, ListResponse, Names, ParameterEvent, SetAtomicallyResponse,
    SetParametersResult, SetRequest, SetResponse, TypesResponse,
};
use crate::msg::topic::Named;
use crate::node::middleware::OpenError;
use crate::node::throttle::Throttle;
use crate::node::transport::{Event, SendError};

/// One of the services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::node) enum ParameterService {
    Get,
    Types,
    Describe,
    List,
    Set,
    SetAtomically,
}

impl ParameterService {
    pub(in crate::node) const ALL: [Self; 6] =
        [Self::Get, Self::Types, Self::Describe, Self::List, Self::Set, Self::SetAtomically];

    /// Its name, below the node's, and its type.
    pub(in crate::node) const fn named(self) -> Named<'static> {
        let (name, type_name) = match self {
            Self::Get => ("~/get_parameters", "rcl_interfaces/srv/GetParameters"),
            Self::Types => ("~/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes"),
            Self::Describe => ("~/describe_parameters", "rcl_interfaces/srv/DescribeParameters"),
            Self::List => ("~/list_parameters", "rcl_interfaces/srv/ListParameters"),
            Self::Set => ("~/set_parameters", "rcl_interfaces/srv/SetParameters"),
            Self::SetAtomically => {
                ("~/set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically")
            }
        };
        Named { name, type_name }
    }
}

/// Calls that wait for one service, as in ROS.
pub(in crate::node) const MOST_CALLS: usize = 1000;

/// What opens a service that is asked `Q` and answers `A`, and has its calls answered.
pub(in crate::node) trait Serves<Q, A> {
    fn serve(
        &mut self,
        service: ParameterService,
        answer: impl AsyncFn(Q) -> A + 'static,
    ) -> Result<(), OpenError>;
}

/// Where what has changed is told.
pub(in crate::node) trait Tells: 'static {
    async fn tell(&self, change: ParameterEvent) -> Result<(), SendError>;
}

/// Opens the services and starts answering.
pub(in crate::node) fn serve<M, R, T>(to: &mut M, setter: Setter<R, T>) -> Result<(), OpenError>
where
    M: Serves<Names, GetResponse>
        + Serves<Names, TypesResponse>
        + Serves<Names, DescribeResponse>
        + Serves<ListRequest, ListResponse>
        + Serves<SetRequest, SetResponse>
        + Serves<SetRequest, SetAtomicallyResponse>,
    R: 'static,
    T: Tells,
{
    let setter = Rc::new(setter);
    for service in ParameterService::ALL {
        let (here, setter) = (Rc::clone(&setter.parameters), Rc::clone(&setter));
        match service {
            ParameterService::Get => {
                to.serve(service, async move |asked| -> GetResponse { here.get(&asked) })
            }
            ParameterService::Types => {
                to.serve(service, async move |asked| -> TypesResponse { here.types(&asked) })
            }
            ParameterService::Describe => {
                to.serve(service, async move |asked| -> DescribeResponse { here.describe(&asked) })
            }
            ParameterService::List => {
                to.serve(service, async move |asked| -> ListResponse { here.list(&asked) })
            }
            ParameterService::Set => {
                to.serve(service, async move |wanted| -> SetResponse { setter.set_each(wanted).await })
            }
            ParameterService::SetAtomically => {
                to.serve(service, async move |wanted| -> SetAtomicallyResponse {
                    SetAtomicallyResponse { result: setter.set(wanted).await }
                })
            }
        }?;
    }
    Ok(())
}

/// Sets parameters and tells of it: the node, and whoever listens to [`super::EVENTS`].
pub(in crate::node) struct Setter<R, T> {
    pub(in crate::node) parameters: Rc<Parameters>,
    pub(in crate::node) changes: T,
    pub(in crate::node) events: Sender<Event<R>>,
}

impl<R, T: Tells> Setter<R, T> {
    /// Each gets an answer, as rclcpp has it, whether or not they are too many: callers read as many as they have asked for.
    async fn set_each(&self, wanted: SetRequest) -> SetResponse {
        let entries = wanted.parameters.len();
        if self.parameters.refuses(entries) {
            // About as long as the request, which has been read whole.
            return SetResponse { results: vec![too_many(); entries] };
        }
        let mut results = Vec::with_capacity(entries);
        for parameter in wanted.parameters {
            tokio::task::yield_now().await;
            results.push(self.set(SetRequest { parameters: vec![parameter] }).await);
        }
        SetResponse { results }
    }

    async fn set(&self, wanted: SetRequest) -> SetParametersResult {
        let (result, change) = self.parameters.set_and_tell(wanted, &self.events).await;
        if let Some(change) = change
            && let Err(error) = self.changes.tell(change).await
        {
            warn!("a change of parameters could not be told: {error}");
        }
        result
    }
}

/// The calls of one service.
pub(in crate::node) trait Calls<Q, A> {
    /// Who is to be answered.
    type Caller;

    /// The next; nothing where the node has ended.
    async fn take(&self) -> Option<(Self::Caller, Q)>;

    async fn answer(&self, caller: Self::Caller, response: A) -> Result<(), SendError>;
}

/// Answers calls until the node ends.
pub(in crate::node) async fn answer_all<Q, A>(
    service: ParameterService,
    calls: impl Calls<Q, A>,
    answer: impl AsyncFn(Q) -> A,
) -> Cow<'static, str> {
    let name = service.named().name;
    let mut throttle = Throttle::default();
    while let Some((caller, request)) = calls.take().await {
        // A flood of calls must not be all that is done.
        tokio::task::yield_now().await;
        let response = answer(request).await;
        if let Err(error) = calls.answer(caller, response).await
            && throttle.allows(name, Instant::now())
        {
            warn!("{name} could not be answered: {error}");
        }
    }
    name.into()
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeSet;

    use tokio::sync::mpsc::channel;

    use super::*;
    use crate::config::Current;
    use crate::msg::parameters::{Parameter, ParameterValue, kind};

    #[derive(Clone, Default)]
    struct Told(Rc<RefCell<Vec<ParameterEvent>>>);

    impl Tells for Told {
        async fn tell(&self, change: ParameterEvent) -> Result<(), SendError> {
            self.0.borrow_mut().push(change);
            Ok(())
        }
    }

    fn timeout(double_value: f64) -> Parameter {
        let value = ParameterValue { kind: kind::DOUBLE, double_value, ..ParameterValue::default() };
        Parameter { name: "tf_timeout".to_owned(), value }
    }

    #[tokio::test]
    async fn of_several_values_each_is_set_by_itself_or_all_or_none() {
        let (events, mut node) = channel::<Event<()>>(16);
        let (told, current) = (Told::default(), Current::new([]).unwrap());
        let parameters = Rc::new(Parameters::new("/cfodi".to_owned(), current));
        let setter = Setter { parameters: Rc::clone(&parameters), changes: told.clone(), events };
        let wanted = SetRequest { parameters: vec![timeout(0.5), timeout(61.0)] };
        assert!(!setter.set(wanted.clone()).await.successful);
        assert!(told.0.borrow().is_empty() && node.try_recv().is_err());
        let each: Vec<_> =
            setter.set_each(wanted).await.results.iter().map(|result| result.successful).collect();
        assert_eq!(each, [true, false]);
        assert_eq!(told.0.borrow().len(), 1);
        assert!(matches!(node.try_recv(), Ok(Event::Changed(_))) && node.try_recv().is_err());
    }

    #[tokio::test]
    async fn of_more_values_than_there_can_be_parameters_none_is_set() {
        let (events, mut node) = channel::<Event<()>>(16);
        let (told, current) = (Told::default(), Current::new([]).unwrap());
        let parameters = Rc::new(Parameters::new("/cfodi".to_owned(), current));
        let setter = Setter { parameters, changes: told.clone(), events };
        let wanted = SetRequest { parameters: vec![timeout(0.5); 257] };
        let each = setter.set_each(wanted.clone()).await.results;
        assert_eq!(each, vec![setter.set(wanted).await; 257]);
        let reason = "a request may have 256 entries at most: there are not as many parameters";
        assert!(!each[0].successful && each[0].reason == reason, "{each:?}");
        assert!(told.0.borrow().is_empty() && node.try_recv().is_err());
    }

    /// Calls that were made before, and their answers.
    struct Made(RefCell<Vec<u8>>, Rc<RefCell<Vec<(u8, u8)>>>);

    impl Calls<u8, u8> for Made {
        type Caller = u8;

        async fn take(&self) -> Option<(u8, u8)> {
            self.0.borrow_mut().pop().map(|call| (call, call))
        }

        async fn answer(&self, caller: u8, response: u8) -> Result<(), SendError> {
            self.1.borrow_mut().push((caller, response));
            Ok(())
        }
    }

    #[tokio::test]
    async fn each_caller_gets_the_answer_to_its_own_call_until_the_node_ends() {
        let answers = Rc::default();
        let calls = Made(RefCell::new(vec![2, 1]), Rc::clone(&answers));
        let ended = answer_all(ParameterService::List, calls, async |call| 10 * call).await;
        assert_eq!((ended.as_ref(), &*answers.borrow()), ("~/list_parameters", &vec![(1, 10), (2, 20)]));
    }

    #[test]
    fn each_service_has_a_name_and_a_type_of_its_own() {
        let names: BTreeSet<_> = ParameterService::ALL.map(|service| service.named().name).into();
        let types: BTreeSet<_> = ParameterService::ALL.map(|service| service.named().type_name).into();
        assert_eq!((names.len(), types.len()), (6, 6));
    }
}
