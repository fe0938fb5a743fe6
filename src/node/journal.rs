//! The node's own bag: inputs as the twin took them, stamped with the tick at which they took effect, and estimates.
//!
//! A replay of this bag gives the estimates again, to the last bit: time is data, and the twin never
//! learns whether a frame came from a bus or from a file. A force on the piston is written as the joint command that asks for it. A unit
//! changed while it runs is told in the log alone.

use std::path::{Path, PathBuf};

use super::core::{NodeInput, Notices, Tick};
use super::messages;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, JointState, ServoState};
use govtwin_bag::{BagError, Qos, Topic, Writer, WriterOptions};
use govtwin_model::frame::Inputs;

/// Topic names of a journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// Names of the inputs, in the order of [`NodeInput::ALL`].
    pub inputs: [String; NodeInput::COUNT],
    /// Name of the simulated servo state.
    pub servo_state: String,
    /// Name of the simulated joint state.
    pub joint_states: String,
}

/// The bag in the making, and those before it.
#[derive(Debug)]
pub struct Journal {
    folder: PathBuf,
    names: Names,
    finished: Vec<PathBuf>,
    bag: OpenBag,
}

#[derive(Debug)]
struct OpenBag {
    writer: Writer,
    command: Topic<GovernorCommand>,
    esv: Topic<EsvState>,
    tank_pressure: Topic<FluidPressure>,
    load: Topic<JointState>,
    servo_state: Topic<ServoState>,
    joint_states: Topic<JointState>,
    previous: Option<Inputs>,
}

impl Journal {
    /// Begins a bag.
    ///
    /// # Errors
    /// Where something is in the way, or the system refuses.
    pub fn create(folder: &Path, names: &Names) -> Result<Self, BagError> {
        let bag = OpenBag::create(folder, names)?;
        Ok(Self { folder: folder.to_owned(), names: names.clone(), finished: Vec::new(), bag })
    }

    /// Writes what a tick took and gave.
    ///
    /// Where time jumped, or the twin was set back, a new bag begins, `FOLDER_2` and so on: within a bag time only rises.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn write(&mut self, tick: &Tick) -> Result<(), BagError> {
        let begins = tick.notices.has(Notices::RESET) || tick.notices.has(Notices::RESTARTED);
        if begins {
            self.begin_another()?;
        }
        self.bag.write(tick)
    }

    /// Begins another bag, where there is something in this one.
    ///
    /// # Errors
    /// Where the system refuses.
    pub(crate) fn begin_another(&mut self) -> Result<(), BagError> {
        if self.bag.previous.is_some() {
            let mut name = self.folder.file_name().unwrap_or_default().to_owned();
            name.push(format!("_{}", self.finished.len() + 2));
            let next = OpenBag::create(&self.folder.with_file_name(name), &self.names)?;
            self.finished.push(std::mem::replace(&mut self.bag, next).writer.finish()?);
        }
        Ok(())
    }

    /// Whether the disk is full: the bag should be completed in the room that was kept for it.
    pub(crate) fn is_full(&self) -> bool {
        self.bag.writer.is_full()
    }

    /// Closes the open chunk, so that a crash loses nothing written before.
    ///
    /// # Errors
    /// Where the system refuses.
    pub(crate) fn flush(&mut self) -> Result<(), BagError> {
        self.bag.writer.flush()
    }

    /// Completes the bag and gives the folders of all.
    ///
    /// # Errors
    /// Where the system refuses.
    pub fn finish(mut self) -> Result<Vec<PathBuf>, BagError> {
        self.finished.push(self.bag.writer.finish()?);
        Ok(self.finished)
    }
}

impl OpenBag {
    fn create(folder: &Path, names: &Names) -> Result<Self, BagError> {
        let mut writer = Writer::create(folder, WriterOptions { keep_unfinished: true, ..WriterOptions::default() })?;
        Ok(Self {
            command: writer.topic(&names.inputs[NodeInput::Command as usize], Qos::SENSOR)?,
            esv: writer.topic(&names.inputs[NodeInput::Esv as usize], Qos::SENSOR)?,
            tank_pressure: writer.topic(&names.inputs[NodeInput::TankPressure as usize], Qos::SENSOR)?,
            servo_state: writer.topic(&names.servo_state, Qos::DEFAULT)?,
            joint_states: writer.topic(&names.joint_states, Qos::DEFAULT)?,
            load: writer.topic(&names.inputs[NodeInput::Load as usize], Qos::SENSOR)?,
            previous: None,
            writer,
        })
    }

    fn write(&mut self, tick: &Tick) -> Result<(), BagError> {
        let Some(estimate) = &tick.estimate else { return Ok(()) };
        let (inputs, time_ns) = (&tick.frame.inputs, tick.frame.time_ns);
        let before = self.previous.replace(*inputs);
        let changed = |same: fn(&Inputs, &Inputs) -> bool| before.is_none_or(|before| !same(&before, inputs));
        // With each state, so that a reader sees no gaps; what speaks only when it changes is recorded so.
        self.writer.write(self.command, time_ns, &messages::command(inputs, time_ns))?;
        self.writer.write(self.tank_pressure, time_ns, &messages::tank_pressure(inputs, time_ns))?;
        if changed(|a, b| a.esv == b.esv) {
            self.writer.write(self.esv, time_ns, &messages::esv(inputs, time_ns))?;
        }
        let force_n = inputs.piston_force_n;
        if before.map_or(0.0, |before| before.piston_force_n).to_bits() != force_n.to_bits() {
            self.writer.write(self.load, time_ns, &messages::load(force_n, time_ns))?;
        }
        self.writer.write(self.servo_state, time_ns, &messages::servo_state(estimate))?;
        self.writer.write(self.joint_states, time_ns, &messages::joint_state(estimate, tick.strokes_m))
    }
}
