use robot_session::Rules;

/// How the device answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceConfig {
    /// The rules of the machine, all of which are kept.
    #[doc(hidden)]
    pub rules: Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the device's machine.
    pub enum Rule {
        /// A request of one connection is not answered on the next.
        ForgetRequest,
    }
}
