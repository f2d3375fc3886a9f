use alloc::string::ToString;

use crate::error::EncodeError;
use crate::instruction::Instruction;
use crate::motion::{Motion, MotionKind, Speed, Target, Termination};
use crate::position::{Configuration, Group, Position};
use crate::program::{Program, Rules};

/// Builds a program move by move.
///
/// ```
/// use fanuc_ls::{Builder, Configuration, Rules, Speed, Termination};
///
/// let mut builder = Builder::new("PICK");
/// builder.comment("first try").user_tool(1).user_frame(0);
/// let home = builder.joints([0.0, 0.0, 0.0, 0.0, -90.0, 0.0]);
/// let part = builder.cartesian([400.0, 0.0, 120.5, 180.0, 0.0, 0.0], Configuration::new("N U T, 0, 0, 0"));
/// builder.joint(home.clone(), Speed::percent(20), Termination::Continuous(50));
/// builder.linear(part, Speed::mm_per_sec(100.0), Termination::Fine);
/// builder.instruction("CALL GRIP_CLOSE");
/// builder.joint(home, Speed::percent(20), Termination::Fine);
/// let program = builder.build(&Rules::default())?;
/// assert_eq!((program.instructions.len(), program.positions.len()), (6, 2));
/// # Ok::<(), fanuc_ls::EncodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Builder {
    program: Program,
    user_frame: u16,
    user_tool: u16,
}

impl Builder {
    /// Creates an empty program with this name, for the first motion group, in user frame 0 with tool 1.
    pub fn new(name: &str) -> Self {
        let mut program = Program { name: name.to_string(), ..Program::default() };
        program.set_comment("");
        program.set_attribute("DEFAULT_GROUP", "1,*,*,*,*");
        Self { program, user_frame: 0, user_tool: 1 }
    }

    /// Sets COMMENT.
    pub fn comment(&mut self, comment: &str) -> &mut Self {
        self.program.set_comment(comment);
        self
    }

    /// Sets DEFAULT_GROUP, such as `*,*,*,*,*` for a program that moves nothing (a background task must not).
    pub fn motion_groups(&mut self, groups: &str) -> &mut Self {
        self.program.set_attribute("DEFAULT_GROUP", groups);
        self
    }

    /// Adds `UFRAME_NUM=`; points that are added from here on are in this frame.
    pub fn user_frame(&mut self, number: u16) -> &mut Self {
        self.user_frame = number;
        self.push(Instruction::UserFrame(number))
    }

    /// Adds `UTOOL_NUM=`; points that are added from here on are of this tool.
    pub fn user_tool(&mut self, number: u16) -> &mut Self {
        self.user_tool = number;
        self.push(Instruction::UserTool(number))
    }

    /// Adds a point by its joints in degrees, J3 from the horizontal. Go there with a motion.
    pub fn joints(&mut self, degrees: [f64; 6]) -> Target {
        self.point(Group::joints(self.user_frame, self.user_tool, degrees))
    }

    /// Adds a point by X, Y, Z in mm and W, P, R in degrees. Go there with a motion.
    pub fn cartesian(&mut self, xyzwpr: [f64; 6], configuration: Configuration) -> Target {
        self.point(Group::cartesian(self.user_frame, self.user_tool, xyzwpr, configuration))
    }

    /// Adds a point.
    pub fn point(&mut self, group: Group) -> Target {
        let number = u32::try_from(self.program.positions.len()).unwrap_or(u32::MAX).saturating_add(1);
        self.program.positions.push(Position::new(number, group));
        Target::position(number)
    }

    /// Adds a `J` motion: all joints arrive together.
    pub fn joint(&mut self, target: Target, speed: Speed, termination: Termination) -> &mut Self {
        self.motion(Motion::new(MotionKind::Joint, target, speed, termination))
    }

    /// Adds an `L` motion: a straight line.
    pub fn linear(&mut self, target: Target, speed: Speed, termination: Termination) -> &mut Self {
        self.motion(Motion::new(MotionKind::Linear, target, speed, termination))
    }

    /// Adds an `S` motion, of the Spline Motion option.
    pub fn spline(&mut self, target: Target, speed: Speed, termination: Termination) -> &mut Self {
        self.motion(Motion::new(MotionKind::Spline, target, speed, termination))
    }

    /// Adds a `C` motion: an arc through `via`.
    pub fn circular(
        &mut self,
        via: Target,
        target: Target,
        speed: Speed,
        termination: Termination,
    ) -> &mut Self {
        let motion = Motion::new(MotionKind::Circular, target, speed, termination);
        self.motion(Motion { via: Some(via), ..motion })
    }

    /// Adds any motion, for options such as `ACC50`.
    pub fn motion(&mut self, motion: Motion) -> &mut Self {
        self.push(Instruction::Motion(motion))
    }

    /// Adds any instruction by its text, such as `CALL WELD_ON` or `!comment`. [`build`](Self::build) rejects text that
    /// cannot be decoded.
    pub fn instruction(&mut self, text: &str) -> &mut Self {
        self.push(Instruction::from_text(text).unwrap_or_else(|| Instruction::Other(text.to_string())))
    }

    /// Builds the program, if a controller would accept it.
    ///
    /// # Errors
    /// As [`Program::check`].
    pub fn build(&self, rules: &Rules) -> Result<Program, EncodeError> {
        self.program.check(rules)?;
        Ok(self.program.clone())
    }

    fn push(&mut self, instruction: Instruction) -> &mut Self {
        self.program.instructions.push(instruction);
        self
    }
}
