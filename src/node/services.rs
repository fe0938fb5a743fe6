//! The six parameter services of a ROS 2 node, for callers on Fast DDS and on Cyclone DDS alike.
//!
//! The two middlewares lay a service call out differently on DDS, and nothing on the wire says which.
//! A call read the wrong way decodes into other, valid-looking numbers. So a server answers only callers
//! whose vendor speaks its own layout; the vendor stands in the first two bytes of the caller's id. Where
//! `RMW_IMPLEMENTATION` does not decide, both layouts are served side by side and each caller is heard
//! by exactly one of them.

pub mod call;
pub mod replies;
pub mod simulation;
pub mod steps;
pub mod upkeep;

use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicU8, Ordering};

use futures::stream::{LocalBoxStream, StreamExt};
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest, GetParameterTypesResponse,
    GetParametersRequest, GetParametersResponse, ListParametersRequest, ListParametersResponse, ListParametersResult,
    SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
};
use ros2_client::{Gid, Message, ParameterValue, Server, ServiceMapping};

use super::bus::{Bus, BusError};
use super::control::{Order, Ticket};
use super::parameters::{ParameterStore, words_of};
use super::refit::Refit;

/// Vendor of Cyclone DDS, the first two bytes of its ids.
pub(super) const CYCLONE: [u8; 2] = [0x01, 0x10];

/// Vendor of RustDDS, whose callers choose a layout for themselves.
const RUST_DDS: [u8; 2] = [0x01, 0x12];

/// Most names or values that a call may hold; the node has fewer than a hundred.
const MOST_ITEMS: usize = 1000;

/// One layout of the six services.
pub struct ParameterServices {
    mapping: ServiceMapping,
    get: Server<GetParametersRequest, GetParametersResponse>,
    get_types: Server<GetParameterTypesRequest, GetParameterTypesResponse>,
    list: Server<ListParametersRequest, ListParametersResponse>,
    set: Server<SetParametersRequest, SetParametersResponse>,
    set_atomically: Server<SetParametersRequest, SetParametersAtomicallyResponse>,
    describe: Server<DescribeParametersRequest, DescribeParametersResponse>,
}

/// What answering a call left to do.
#[derive(Debug, Default)]
pub struct Aftermath {
    /// Parameters that changed.
    pub changed: Vec<raw::Parameter>,
    /// Words for the log.
    pub words: Vec<String>,
    /// Orders for the loop.
    pub orders: Vec<(Order, Ticket)>,
    /// A twin of the changed unit, for the loop.
    pub refit: Option<Box<Refit>>,
}

/// What the answers share.
pub struct ServiceContext<'a> {
    /// The parameters.
    pub store: RefCell<ParameterStore>,
    /// Why the unit cannot be changed while the node runs; `None` where it can.
    pub fixed_unit: Option<&'static str>,
    /// Whether the loop has room for another twin.
    pub room_for_twins: Cell<bool>,
    least: &'a AtomicU8,
    mappings: Vec<ServiceMapping>,
    strangers: RefCell<Vec<[u8; 2]>>,
}

impl<'a> ServiceContext<'a> {
    /// A context for these parameters, serving these layouts; `least` is the level below which nothing is told.
    #[must_use]
    pub fn new(store: ParameterStore, mappings: &[ServiceMapping], least: &'a AtomicU8) -> Self {
        Self {
            store: RefCell::new(store),
            fixed_unit: None,
            room_for_twins: Cell::new(true),
            least,
            mappings: mappings.to_vec(),
            strangers: RefCell::default(),
        }
    }

    /// The level below which nothing is told.
    #[must_use]
    pub fn least(&self) -> u8 {
        self.least.load(Ordering::Relaxed)
    }

    /// Sets the level below which nothing is told.
    pub fn set_least(&self, level: u8) {
        self.least.store(level, Ordering::Relaxed);
    }

    /// Whether a server of `mapping` is the one to answer this caller.
    fn is_for(&self, mapping: ServiceMapping, vendor: [u8; 2]) -> bool {
        match vendor {
            CYCLONE => mapping == ServiceMapping::Cyclone,
            RUST_DDS => self.mappings.first() == Some(&mapping),
            _ => mapping == ServiceMapping::Enhanced,
        }
    }

    /// Whether this layout is served, and is the one for this caller.
    pub(super) fn serves(&self, mapping: ServiceMapping, vendor: [u8; 2]) -> bool {
        self.mappings.contains(&mapping) && self.is_for(mapping, vendor)
    }

    /// Words for a caller whom no server answers, the first time.
    fn turn_away(&self, vendor: [u8; 2]) -> Option<String> {
        if self.mappings.iter().any(|&mapping| self.serves(mapping, vendor)) {
            return None;
        }
        let mut strangers = self.strangers.borrow_mut();
        if strangers.contains(&vendor) {
            return None;
        }
        strangers.push(vendor);
        Some(format!(
            "a service call from DDS vendor {:02x}.{:02x} is not answered: its layout is not the one that \
             RMW_IMPLEMENTATION asks for; leave that variable unset to serve Fast DDS and Cyclone DDS both",
            vendor[0], vendor[1]
        ))
    }
}

impl ParameterServices {
    /// Opens the six services under the node's name.
    ///
    /// # Errors
    /// When DDS refuses.
    pub fn open(bus: &mut Bus, mapping: ServiceMapping) -> Result<Self, BusError> {
        Ok(Self {
            mapping,
            get: bus.serve(mapping, "~/get_parameters", "rcl_interfaces/GetParameters")?,
            get_types: bus.serve(mapping, "~/get_parameter_types", "rcl_interfaces/GetParameterTypes")?,
            list: bus.serve(mapping, "~/list_parameters", "rcl_interfaces/ListParameters")?,
            set: bus.serve(mapping, "~/set_parameters", "rcl_interfaces/SetParameters")?,
            set_atomically: bus.serve(
                mapping,
                "~/set_parameters_atomically",
                "rcl_interfaces/SetParametersAtomically",
            )?,
            describe: bus.serve(mapping, "~/describe_parameters", "rcl_interfaces/DescribeParameters")?,
        })
    }

    /// Answers calls as they come; each item says what an answer left to do.
    pub fn answers<'a>(&'a self, context: &'a ServiceContext<'a>) -> Vec<LocalBoxStream<'a, Aftermath>> {
        let mapping = self.mapping;
        vec![
            answer(mapping, &self.get, context, |request, context, _| {
                let store = context.store.borrow();
                let values = request.names.iter().take(MOST_ITEMS).map(|name| store.value(name).into());
                GetParametersResponse { values: values.collect() }
            }),
            answer(mapping, &self.get_types, context, |request, context, _| {
                let store = context.store.borrow();
                let types = request
                    .names
                    .iter()
                    .take(MOST_ITEMS)
                    .map(|name| ParameterValue::to_parameter_type_raw(&store.value(name)));
                GetParameterTypesResponse { values: types.collect() }
            }),
            answer(mapping, &self.list, context, |request, context, _| {
                let (names, prefixes) = context.store.borrow().list(&request.prefixes, request.depth);
                ListParametersResponse { result: ListParametersResult { names, prefixes } }
            }),
            answer(mapping, &self.describe, context, |request, context, _| {
                let store = context.store.borrow();
                let values = request.names.iter().take(MOST_ITEMS).map(|name| store.describe(name));
                DescribeParametersResponse { values: values.collect() }
            }),
            answer(mapping, &self.set, context, |request, context, aftermath| {
                let items = request.parameter.into_iter().take(MOST_ITEMS);
                SetParametersResponse { results: items.map(|item| set(&[item], context, aftermath)).collect() }
            }),
            answer(mapping, &self.set_atomically, context, |request, context, aftermath| {
                let few = request.parameter.len() <= MOST_ITEMS;
                let items = if few { request.parameter.as_slice() } else { &[] };
                SetParametersAtomicallyResponse { result: set(items, context, aftermath) }
            }),
        ]
    }
}

/// Sets all or none.
fn set(items: &[raw::Parameter], context: &ServiceContext<'_>, aftermath: &mut Aftermath) -> raw::SetParametersResult {
    let refuse = |reason| raw::SetParametersResult { successful: false, reason };
    let mut changed = context.store.borrow().clone();
    let mut words = Vec::new();
    for item in items {
        let value: ParameterValue = item.value.clone().into();
        words.push(format!("parameter `{}` set to {}", item.name, words_of(&value)));
        if let Err(reason) = changed.set(&item.name, value) {
            return refuse(reason);
        }
    }
    if changed.unit() != context.store.borrow().unit() {
        if let Some(reason) = context.fixed_unit {
            return refuse(reason.to_owned());
        }
        if let Err(reason) = changed.check_unit() {
            return refuse(reason);
        }
        if !context.room_for_twins.get() {
            return refuse("the changes before this one have not taken hold yet; try again".to_owned());
        }
        aftermath.refit = Some(Box::new(Refit::new(changed.unit())));
    }
    *context.store.borrow_mut() = changed;
    aftermath.words.append(&mut words);
    aftermath.changed.extend(items.iter().cloned());
    raw::SetParametersResult { successful: true, reason: String::new() }
}

/// Sends the answer to one call; `false` where it is lost.
type Send<'a, Response> = Box<dyn FnOnce(Response) -> bool + std::marker::Send + 'a>;

/// The stream that answers one service at once.
fn answer<'a, Request, Response>(
    mapping: ServiceMapping,
    server: &'a Server<Request, Response>,
    context: &'a ServiceContext<'a>,
    respond: impl Fn(Request, &ServiceContext<'_>, &mut Aftermath) -> Response + 'a,
) -> LocalBoxStream<'a, Aftermath>
where
    Request: Message + Sync + 'static,
    Response: Message + Sync + 'static,
{
    attend(mapping, server, context, move |request, context, aftermath, send| {
        let response = respond(request, context, aftermath);
        if !send(response) {
            aftermath.words.push("an answer to a service call was lost".to_owned());
        }
    })
}

/// The stream of one service, whose calls may be answered later.
fn attend<'a, 's: 'a, Request, Response>(
    mapping: ServiceMapping,
    server: &'s Server<Request, Response>,
    context: &'a ServiceContext<'a>,
    take: impl Fn(Request, &ServiceContext<'_>, &mut Aftermath, Send<'s, Response>) + 'a,
) -> LocalBoxStream<'a, Aftermath>
where
    Request: Message + Sync + 'static,
    Response: Message + Sync + 'static,
{
    let answered = server.receive_request_stream().map(move |call| {
        let mut aftermath = Aftermath::default();
        // A call in the other layout often does not decode; the other server has it.
        let Ok((id, request)) = call else { return aftermath };
        let vendor = vendor_of(id.writer_gid);
        if context.is_for(mapping, vendor) {
            take(
                request,
                context,
                &mut aftermath,
                Box::new(move |response| server.send_response(id, response).is_ok()),
            );
        } else {
            aftermath.words.extend(context.turn_away(vendor));
        }
        aftermath
    });
    answered.boxed_local()
}

fn vendor_of(id: Gid) -> [u8; 2] {
    let bytes = id.to_bytes16();
    [bytes[0], bytes[1]]
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU8;

    use ros2_client::ServiceMapping::{Cyclone, Enhanced};
    use ros2_client::parameters::{ParameterValue, raw};

    use super::{Aftermath, ServiceContext, set};
    use crate::parameters::ParameterStore;
    use crate::settings::NodeSettings;

    static LEAST: AtomicU8 = AtomicU8::new(20);

    fn context(mappings: &[ros2_client::ServiceMapping]) -> ServiceContext<'static> {
        ServiceContext::new(
            ParameterStore::new(&NodeSettings::default(), &govtwin_model::params::reference()),
            mappings,
            &LEAST,
        )
    }

    #[test]
    fn each_caller_is_answered_by_exactly_one_layout() {
        let both = context(&[Enhanced, Cyclone]);
        for vendor in [[1, 0x0f], [1, 0x10], [1, 0x12], [1, 1], [9, 9]] {
            let answering = [Enhanced, Cyclone].into_iter().filter(|&mapping| both.is_for(mapping, vendor)).count();
            assert_eq!(answering, 1, "{vendor:?}");
            assert_eq!(both.turn_away(vendor), None);
        }
    }

    #[test]
    fn a_caller_of_the_other_layout_is_turned_away_once_in_words() {
        let cyclone_only = context(&[Cyclone]);
        assert!(!cyclone_only.is_for(Cyclone, [1, 0x0f]));
        assert!(cyclone_only.turn_away([1, 0x0f]).unwrap().contains("RMW_IMPLEMENTATION"));
        assert_eq!(cyclone_only.turn_away([1, 0x0f]), None);
        assert!(cyclone_only.is_for(Cyclone, [1, 0x12]));
    }

    #[test]
    fn an_atomic_set_changes_all_or_nothing() {
        let context = context(&[Enhanced]);
        let item =
            |name: &str, value| raw::Parameter { name: name.to_owned(), value: ParameterValue::Double(value).into() };
        let mut aftermath = Aftermath::default();
        let outcome = set(&[item("hold", 4.0), item("stale_after", -1.0)], &context, &mut aftermath);
        assert!(!outcome.successful && outcome.reason.contains("stale_after") && aftermath.changed.is_empty());
        assert_eq!(context.store.borrow().value("hold"), ParameterValue::Double(1.0));
        let outcome = set(&[item("hold", 4.0), item("stale_after", 3.0)], &context, &mut aftermath);
        assert!(outcome.successful && aftermath.changed.len() == 2);
        assert_eq!(context.store.borrow().value("hold"), ParameterValue::Double(4.0));
    }

    #[test]
    fn the_unit_and_its_effects_change_together_or_not_at_all() {
        let mut context = context(&[Enhanced]);
        let item =
            |name: &str, value| raw::Parameter { name: name.to_owned(), value: ParameterValue::Double(value).into() };
        let mut aftermath = Aftermath::default();
        let leak = item("effects.servo_leak.leakage_m3_s_pa", 1e-9);
        // A return line above the tank's pressure contradicts the sheet, whatever else is right.
        let outcome = set(
            &[leak.clone(), item("unit.oil.return_pressure_pa", 4.9e6), item("unit.oil.tank_pressure_pa", 5.0e5)],
            &context,
            &mut aftermath,
        );
        assert!(!outcome.successful && outcome.reason.contains("return_pressure_pa"), "{}", outcome.reason);
        assert!(aftermath.refit.is_none() && context.store.borrow().unit().effects.is_empty());
        let outcome = set(&[leak.clone(), item("unit.servomotor.load_closed_n", 2.0e5)], &context, &mut aftermath);
        assert!(outcome.successful, "{}", outcome.reason);
        assert!(aftermath.refit.take().is_some());
        let unit = context.store.borrow().unit().clone();
        assert_eq!(unit.effects[0].id, "servo_leak");
        assert_eq!(unit.parameters.servomotor.load_closed_n.to_bits(), 2.0e5_f64.to_bits());
        // Back to neutral the effect is gone.
        assert!(set(&[item("effects.servo_leak.leakage_m3_s_pa", 0.0)], &context, &mut aftermath).successful);
        assert!(context.store.borrow().unit().effects.is_empty());
        context.room_for_twins.set(false);
        assert!(set(std::slice::from_ref(&leak), &context, &mut aftermath).reason.contains("try again"));
        context.fixed_unit = Some("a residual");
        assert_eq!(set(&[leak], &context, &mut aftermath).reason, "a residual");
    }
}
