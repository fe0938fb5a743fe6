//! A topic of inputs, as its publishers offer it.

use futures::stream::{LocalBoxStream, StreamExt, select};
use ros2_client::{MessageInfo, ReadError, Subscription};
use serde::de::DeserializeOwned;

use super::super::bus::{Bus, BusError};
use super::super::policy::NodeInput;
use super::super::qos;
use super::super::settings::NodeSettings;
use super::Listener;
use govtwin_bag::msg::Interface;

/// A sample, or why it cannot be read.
pub(super) type Sample<M> = Result<(M, MessageInfo), ReadError>;

/// Where each sample is needed, a topic is read twice: reliably, so that lost ones are sent again, and best effort for publishers that offer no
/// more. In DDS no reader does both.
pub(super) struct Input<M> {
    reader: Subscription<M>,
    best_effort: Option<Subscription<M>>,
}

impl<M: Interface + DeserializeOwned + 'static> Input<M> {
    /// Opens a topic; `qos_overrides` that name its reliability have it read in this one way.
    pub(super) fn open(bus: &mut Bus, input: NodeInput, settings: &NodeSettings) -> Result<Self, BusError> {
        let topic = input.topic();
        // What a step waits for must be sent again where it is lost, and so must what belongs to a time of the clock.
        let is_awaited = settings.use_sim_time || settings.step_inputs[input as usize];
        let is_twofold = is_awaited && !bus.has_reliability(topic)?;
        let reader = bus.subscribe_with(topic, if is_awaited { qos::awaited() } else { qos::best_effort() })?;
        let best_effort = if is_twofold { Some(bus.subscribe_with(topic, qos::followed())?) } else { None };
        Ok(Self { reader, best_effort })
    }

    /// Its samples as they come, each once.
    pub(super) fn stream<'s>(&'s self, listener: &'s Listener<'_>) -> LocalBoxStream<'s, Sample<M>> {
        let reader = self.reader.async_stream();
        let Some(best_effort) = &self.best_effort else { return reader.boxed_local() };
        let others = best_effort.async_stream();
        select(reader, others.filter(|sample| std::future::ready(!listener.is_read_reliably(sample)))).boxed_local()
    }

    /// The next sample that has come, if any.
    pub(super) fn take(&self, listener: &Listener<'_>) -> Option<Sample<M>> {
        let mut others = std::iter::from_fn(|| self.best_effort.as_ref()?.take().transpose());
        self.reader.take().transpose().or_else(|| others.find(|sample| !listener.is_read_reliably(sample)))
    }
}

impl Listener<'_> {
    /// Whether a sample that came best effort comes through the reliable reader as well.
    fn is_read_reliably<M>(&self, sample: &Sample<M>) -> bool {
        let Ok((_, info)) = sample else { return false };
        let sender = info.publisher_gid();
        let known = self.reliable.borrow().get(&sender).copied();
        known.unwrap_or_else(|| {
            let found = self.bus.is_reliable(sender);
            self.reliable.borrow_mut().extend(found.map(|is_reliable| (sender, is_reliable)));
            found.unwrap_or(false)
        })
    }
}
