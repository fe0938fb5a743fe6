//! What a node hears that follows `/clock`: dealt with in the order in which it came, whatever topic it came on.
//!
//! Each topic has a queue of its own. A node that falls behind finds several samples in each, and must not take a tick of the clock before the
//! command that came before it, nor a command before the tick that it came after.

use futures::stream::{LocalBoxStream, StreamExt, select_all};
use ros2_client::Subscription;
use serde::de::DeserializeOwned;

use super::super::realtime::monotonic_ns;
use super::input::{Input, Sample};
use super::{Arrivals, InputEvent, Listener, NativeInputs};
use govtwin_bag::msg::{Clock, Interface, JointState};

/// Most samples that are put in order at a time; of more the rest follows.
const MOST_TOGETHER: usize = 4096;

/// What is done with a sample, and when it came, ns; of two that came at once the clock is the later one.
struct Arrived<'s> {
    place: (i64, bool),
    take: Box<dyn FnOnce() + 's>,
}

/// A topic: the next of its samples that has come, if any.
type Queue<'s> = Box<dyn Fn() -> Option<Arrived<'s>> + 's>;

/// A topic as its samples come, and as those that have come can be taken at once.
type Way<'s> = (LocalBoxStream<'s, Arrived<'s>>, Queue<'s>);

impl Listener<'_> {
    /// The inputs and the clock.
    pub(super) fn in_order<'s>(
        &'s self,
        native: Option<&'s NativeInputs>,
        joint_commands: &'s Input<JointState>,
        clock: &'s Subscription<Clock>,
    ) -> Arrivals<'s> {
        let ticks = arrived(true, |sample| self.tick(sample));
        let mut ways: Vec<Way<'s>> = vec![
            (clock.async_stream().map(ticks).boxed_local(), Box::new(move || clock.take().transpose().map(ticks))),
            self.way(joint_commands, |sample| self.asked(sample)),
        ];
        if let Some(native) = native {
            ways.push(self.way(&native.command, |sample| self.sample(sample)));
            ways.push(self.way(&native.esv, |sample| self.sample(sample)));
            ways.push(self.way(&native.tank_pressure, |sample| self.sample(sample)));
        }
        let (streams, queues): (Vec<_>, Vec<_>) = ways.into_iter().unzip();
        select_all(streams).map(move |first| take_all(first, &queues)).boxed_local()
    }

    /// An input whose samples go to `take`.
    fn way<'s, M: Interface + DeserializeOwned + 'static>(
        &'s self,
        input: &'s Input<M>,
        take: impl Fn(Sample<M>) + Copy + 's,
    ) -> Way<'s> {
        let arrived = arrived(false, take);
        (input.stream(self).map(arrived).boxed_local(), Box::new(move || input.take(self).map(arrived)))
    }

    /// A time of the clock.
    fn tick(&self, sample: Sample<Clock>) {
        let Ok((clock, info)) = sample else { return };
        if let Some(time_ns) = clock.clock.nanos().filter(|_| self.may_command(info.publisher_gid(), "/clock")) {
            self.clock.note(time_ns, monotonic_ns());
            self.tell(InputEvent::Clock(time_ns));
        }
    }
}

/// A sample with its place, to go to `take`.
fn arrived<'s, M: 's>(
    is_clock: bool,
    take: impl Fn(Sample<M>) + Copy + 's,
) -> impl Fn(Sample<M>) -> Arrived<'s> + Copy {
    move |sample| {
        let came = sample.as_ref().ok().and_then(|(_, info)| info.received_timestamp());
        let place = (came.map_or(0, |came| came.to_nanos()), is_clock);
        Arrived { place, take: Box::new(move || take(sample)) }
    }
}

/// Takes what has come on all ways, and deals with it in its order. All of it was there once a look at each way finds nothing more.
fn take_all<'s>(first: Arrived<'s>, queues: &[Queue<'s>]) {
    let mut all = vec![first];
    loop {
        let before = all.len();
        for queue in queues {
            all.extend(std::iter::from_fn(queue).take(MOST_TOGETHER));
        }
        if all.len() == before || before > MOST_TOGETHER {
            break;
        }
    }
    all.sort_by_key(|arrived| arrived.place);
    for arrived in all {
        (arrived.take)();
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::VecDeque;

    use super::{Arrived, Queue, take_all};

    #[test]
    fn samples_of_several_topics_are_taken_in_the_order_in_which_they_came() {
        let taken = RefCell::new(Vec::new());
        let taken_ref = &taken;
        let arrived = |time_ns: i64, is_clock: bool, name: &'static str| Arrived {
            place: (time_ns, is_clock),
            take: Box::new(move || taken_ref.borrow_mut().push(name)),
        };
        // The clock's queue has more ticks than there are commands, and one command comes while the others are looked at.
        let clock = [(10, "t10"), (20, "t20"), (30, "t30")].map(|(time_ns, name)| arrived(time_ns, true, name));
        let clock = RefCell::new(VecDeque::from(clock));
        let commands = RefCell::new(VecDeque::from([arrived(20, false, "c20"), arrived(25, false, "c25")]));
        let late = RefCell::new(Some(arrived(5, false, "c5")));
        let queues: [Queue<'_>; 2] = [
            Box::new(|| clock.borrow_mut().pop_front()),
            Box::new(|| commands.borrow_mut().pop_front().or_else(|| late.borrow_mut().take())),
        ];
        take_all(arrived(22, false, "p22"), &queues);
        assert_eq!(*taken.borrow(), ["c5", "t10", "c20", "t20", "p22", "c25", "t30"]);
    }
}
