/// The configuration of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeviceConfig {
    /// The rules of the machine, all of which are kept.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub rules: robot_session::end::Rules<Rule>,
}

robot_session::rules! {
    /// The rules of the device's machine.
    pub enum Rule for DeviceConfig {
        /// A request of one connection is not answered on the next.
        ForgetRequest,
    }
}
