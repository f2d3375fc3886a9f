//! Decides the answer to a good frame.

use robot_work_queue::{Wake, Writer};

use super::config::ControllerConfig;
use crate::instruction::{Instruction, Instructions, word_of};
use crate::items::{Item, Items};
use crate::words::{Class, Refusal};

pub(super) enum Verdict<'a> {
    /// All instructions of the frame have been queued.
    Queued { word: u16, count: u8 },
    /// The only one is to be executed.
    Execute { class: Class, instruction: Instruction<'a> },
}

/// Checks the items of a frame. Queues interpreted instructions: all of them, or none.
pub(super) fn judge<'a, T, R: Wake>(
    items: Items<'a>,
    config: &ControllerConfig,
    queue: &mut Writer<'_, T, R>,
) -> Result<Verdict<'a>, Refusal>
where
    T: for<'i> TryFrom<Instruction<'i>>,
{
    let instruction = Instruction::single(items).map_err(|_| Refusal::BadFrame)?;
    let word = instruction.word;
    let class = config.words.class(word).ok_or(Refusal::UnknownCommand)?;
    if class != Class::Interpreted {
        if holds_command(instruction.parameters, config) {
            return Err(Refusal::BadBatch);
        }
        check_values(instruction.parameters)?;
        return Ok(Verdict::Execute { class, instruction });
    }
    let mut count = 0u8;
    for instruction in Instructions::new(items) {
        let instruction = instruction.map_err(|_| Refusal::BadFrame)?;
        match config.words.class(instruction.word) {
            Some(Class::Interpreted) if count < config.batch => count += 1,
            Some(_) => return Err(Refusal::BadBatch),
            None => return Err(Refusal::UnknownCommand),
        }
        check_values(instruction.parameters)?;
        T::try_from(instruction).map_err(|_| Refusal::BadParameters)?;
    }
    // Only this end fills the queue: free slots stay free.
    if queue.free() < usize::from(count) {
        return Err(Refusal::QueueFull);
    }
    for instruction in Instructions::new(items).flatten() {
        if let (Ok(job), Ok(claim)) = (T::try_from(instruction), queue.claim()) {
            claim.push(job);
        }
    }
    Ok(Verdict::Queued { word, count })
}

/// Returns whether a command word is among the parameters, so that another instruction begins there.
fn holds_command(parameters: Items<'_>, config: &ControllerConfig) -> bool {
    let mut words = parameters.flatten().filter_map(|item| word_of(&item));
    words.any(|word| config.words.class(word).is_some())
}

/// Checks that no position, no angle and no power is a NaN or an infinity.
fn check_values(parameters: Items<'_>) -> Result<(), Refusal> {
    let finite = parameters.flatten().all(|item| match item {
        Item::F32(values) => values.iter().all(f32::is_finite),
        Item::I16(_) | Item::U8(_) | Item::Char(_) => true,
    });
    if finite { Ok(()) } else { Err(Refusal::BadParameters) }
}
