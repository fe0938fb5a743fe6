//! Services: requests and responses as `serde` structs in field order, tied to their ROS 2 names and `.srv` texts.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::definition::{Definition, DefinitionError};

/// A ROS 2 service type.
pub trait Service {
    /// Full ROS 2 name, `package/srv/Type`.
    const TYPE_NAME: &'static str;
    /// Its `.srv` text.
    const TEXT: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned;
    /// What is answered.
    type Response: Serialize + DeserializeOwned;

    /// Definitions of request and response.
    ///
    /// # Errors
    /// On a text that cannot be read; a test reads all.
    fn definitions() -> Result<[Definition; 2], DefinitionError> {
        let (request, response) = Self::TEXT.split_once("---\n").unwrap_or((Self::TEXT, ""));
        let named = |half: &str| format!("{}_{half}", Self::TYPE_NAME);
        Ok([Definition::parse(&named("Request"), request)?, Definition::parse(&named("Response"), response)?])
    }
}

/// Ties requests and responses to a service's name.
macro_rules! services {
    ($($service:ident($request:ident, $response:ident) = $name:literal),+ $(,)?) => {$(
        #[doc = concat!("`", $name, "`.")]
        #[derive(Clone, Copy, Debug)]
        pub enum $service {}

        impl $crate::msg::service::Service for $service {
            const TYPE_NAME: &'static str = $name;
            const TEXT: &'static str = include_str!(concat!("../../../msg/standard/", $name, ".srv"));
            type Request = $request;
            type Response = $response;
        }
    )+};
}

/// Lets ros2-client carry these structs.
macro_rules! carried {
    ($($kind:ident),+ $(,)?) => {$(
        #[cfg(feature = "ros2")]
        impl ros2_client::Message for $kind {}
    )+};
}

pub(super) use {carried, services};

/// A request without fields: ROS 2 puts this member in, since a structure in C may not be empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Nothing {
    /// Without meaning.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`Trigger`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it was done.
    pub success: bool,
    /// What was done, or why not.
    pub message: String,
}

services!(Trigger(Nothing, TriggerResponse) = "std_srvs/srv/Trigger");
carried!(Nothing, TriggerResponse);
