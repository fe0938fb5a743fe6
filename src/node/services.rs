//! The six parameter services of a ROS 2 node, for callers on Fast DDS and on Cyclone DDS alike ([`call`] says how).

pub(crate) mod call;
pub(crate) mod replies;
pub(crate) mod simulation;
pub(crate) mod steps;
pub(crate) mod upkeep;

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicU8, Ordering};

use futures::stream::LocalBoxStream;
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest, GetParameterTypesResponse,
    GetParametersRequest, GetParametersResponse, ListParametersRequest, ListParametersResponse, ListParametersResult,
    SetParametersAtomicallyResponse, SetParametersRequest, SetParametersResponse,
};
use ros2_client::{Gid, ParameterValue, ServiceMapping};

use self::call::Calls;
use super::bus::{Bus, BusError};
use super::commanders::Commanders;
use super::control::{Order, Ticket};
use super::parameters::{ParameterStore, words_of};
use super::refit::Refit;

/// Vendor of Cyclone DDS, the first two bytes of its ids.
pub(super) const CYCLONE: [u8; 2] = [0x01, 0x10];

/// Vendor of RustDDS, whose callers choose a layout for themselves.
const RUST_DDS: [u8; 2] = [0x01, 0x12];

/// Most names or values that a call may hold; the node has fewer than a hundred.
const MOST_ITEMS: usize = 1000;

/// The six services.
pub(crate) struct ParameterServices {
    get: Calls,
    get_types: Calls,
    list: Calls,
    set: Calls,
    set_atomically: Calls,
    describe: Calls,
}

/// What answering a call left to do.
#[derive(Debug, Default)]
pub(crate) struct Aftermath {
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
pub(crate) struct ServiceContext<'a> {
    /// The parameters.
    pub store: RefCell<ParameterStore>,
    /// Whether the loop has room for another twin.
    pub room_for_twins: Cell<bool>,
    least: &'a AtomicU8,
    /// The layout of callers whose vendor does not say which it is.
    layout: ServiceMapping,
    /// Callers may ask, and change nothing.
    pub read_only: bool,
    /// Who may call for changes; all where there is no list.
    pub commanders: Option<Rc<Commanders<'a>>>,
    /// Who calls now.
    caller: Cell<Gid>,
}

/// Why a node refuses what would change it.
const READ_ONLY: &str = "this node is read-only (`--read-only`): it answers questions, and nobody changes it by a call";

/// Why a node refuses a change to a caller who is not on its list.
const NOT_COMMANDER: &str = "only the commanders of this node (`--commanders`) change it; the caller is not among them, as the graph of ROS has it";

impl<'a> ServiceContext<'a> {
    /// A context for these parameters; `layout` is that of callers whose vendor does not say which it is, `least` the level below which nothing is told.
    pub(crate) fn new(store: ParameterStore, layout: ServiceMapping, least: &'a AtomicU8) -> Self {
        Self {
            store: RefCell::new(store),
            room_for_twins: Cell::new(true),
            least,
            layout,
            read_only: false,
            commanders: None,
            caller: Cell::new(Gid::ZERO),
        }
    }

    /// Why the caller of now may not change the node; none where it may.
    pub(super) fn refusal(&self) -> Option<&'static str> {
        let may = || self.commanders.as_ref().is_none_or(|commanders| commanders.may(self.caller.get()));
        if self.read_only { Some(READ_ONLY) } else { (!may()).then_some(NOT_COMMANDER) }
    }

    /// The level below which nothing is told.
    pub(crate) fn least(&self) -> u8 {
        self.least.load(Ordering::Relaxed)
    }

    /// Sets the level below which nothing is told.
    pub(crate) fn set_least(&self, level: u8) {
        self.least.store(level, Ordering::Relaxed);
    }

    /// How a caller of this vendor lays its calls out.
    pub(super) fn layout_of(&self, vendor: [u8; 2]) -> ServiceMapping {
        match vendor {
            CYCLONE => ServiceMapping::Cyclone,
            RUST_DDS => self.layout,
            _ => ServiceMapping::Enhanced,
        }
    }
}

impl ParameterServices {
    /// Opens the six services under the node's name.
    ///
    /// # Errors
    /// When DDS refuses.
    pub(crate) fn open(bus: &mut Bus) -> Result<Self, BusError> {
        let mut calls = |name: &str, kind: &str| bus.calls(&format!("~/{name}"), &format!("rcl_interfaces/srv/{kind}"));
        Ok(Self {
            get: calls("get_parameters", "GetParameters")?,
            get_types: calls("get_parameter_types", "GetParameterTypes")?,
            list: calls("list_parameters", "ListParameters")?,
            set: calls("set_parameters", "SetParameters")?,
            set_atomically: calls("set_parameters_atomically", "SetParametersAtomically")?,
            describe: calls("describe_parameters", "DescribeParameters")?,
        })
    }

    /// Whether all who set parameters have their responses.
    pub(crate) fn is_answered(&self) -> bool {
        self.set.is_answered() && self.set_atomically.is_answered()
    }

    /// Answers calls as they come; each item says what an answer left to do.
    pub(crate) fn answers<'a>(&'a self, context: &'a ServiceContext<'a>) -> Vec<LocalBoxStream<'a, Aftermath>> {
        vec![
            self.get.answer(context, |request: GetParametersRequest, context, _| {
                let store = context.store.borrow();
                let values = request.names.iter().take(MOST_ITEMS).map(|name| store.value(name).into());
                GetParametersResponse { values: values.collect() }
            }),
            self.get_types.answer(context, |request: GetParameterTypesRequest, context, _| {
                let store = context.store.borrow();
                let types = request
                    .names
                    .iter()
                    .take(MOST_ITEMS)
                    .map(|name| ParameterValue::to_parameter_type_raw(&store.value(name)));
                GetParameterTypesResponse { values: types.collect() }
            }),
            self.list.answer(context, |request: ListParametersRequest, context, _| {
                let (names, prefixes) = context.store.borrow().list(&request.prefixes, request.depth);
                ListParametersResponse { result: ListParametersResult { names, prefixes } }
            }),
            self.describe.answer(context, |request: DescribeParametersRequest, context, _| {
                let store = context.store.borrow();
                let values = request.names.iter().take(MOST_ITEMS).map(|name| store.describe(name));
                DescribeParametersResponse { values: values.collect() }
            }),
            self.set.answer(context, |request: SetParametersRequest, context, aftermath| {
                let items = request.parameter.into_iter().take(MOST_ITEMS);
                SetParametersResponse { results: items.map(|item| set(&[item], context, aftermath)).collect() }
            }),
            self.set_atomically.answer(context, |request: SetParametersRequest, context, aftermath| {
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
    if let Some(reason) = context.refusal() {
        return refuse(reason.to_owned());
    }
    let mut changed = context.store.borrow().clone();
    let mut words = Vec::new();
    for item in items {
        let value: ParameterValue = item.value.clone().into();
        words.push(format!("parameter `{}` set to {}", item.name, words_of(&value)));
        if let Err(reason) = changed.set(&item.name, value) {
            return refuse(reason);
        }
    }
    if let Err(reason) = changed.check_together() {
        return refuse(reason);
    }
    if changed.unit() != context.store.borrow().unit() {
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU8;

    use ros2_client::ServiceMapping::{Cyclone, Enhanced};
    use ros2_client::parameters::{ParameterValue, raw};

    use super::{Aftermath, ServiceContext, set};
    use crate::parameters::ParameterStore;
    use crate::settings::NodeSettings;

    static LEAST: AtomicU8 = AtomicU8::new(20);

    fn context() -> ServiceContext<'static> {
        let store = ParameterStore::new(&NodeSettings::default(), &govtwin_model::params::reference());
        ServiceContext::new(store, Enhanced, &LEAST)
    }

    #[test]
    fn each_caller_is_read_in_the_layout_of_its_vendor() {
        let mut context = context();
        assert_eq!(context.layout_of([1, 0x10]), Cyclone);
        assert!([[1, 0x0f], [1, 1], [9, 9], [1, 0x12]].into_iter().all(|vendor| context.layout_of(vendor) == Enhanced));
        context.layout = Cyclone;
        assert_eq!((context.layout_of([1, 0x12]), context.layout_of([1, 0x0f])), (Cyclone, Enhanced));
    }

    #[test]
    fn a_node_that_is_read_only_takes_no_parameter() {
        let mut context = context();
        context.read_only = true;
        let item = raw::Parameter { name: "hold".to_owned(), value: ParameterValue::Double(4.0).into() };
        let mut aftermath = Aftermath::default();
        let outcome = set(&[item], &context, &mut aftermath);
        assert!(!outcome.successful && outcome.reason.contains("--read-only") && aftermath.changed.is_empty());
        assert_eq!(context.store.borrow().value("hold"), ParameterValue::Double(1.0));
    }

    #[test]
    fn an_atomic_set_changes_all_or_nothing() {
        let context = context();
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
        let context = context();
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
        assert!(set(&[leak], &context, &mut aftermath).reason.contains("try again"));
    }
}
