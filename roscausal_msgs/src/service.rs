//! Service types: a question and its answer.

use md5::{Digest, Md5};

use crate::{Message, definition::hex};

/// A ROS service type. In ROS 1 its messages are `NameRequest` and `NameResponse`, in ROS 2 `Name_Request` and
/// `Name_Response`.
///
/// ```
/// use roscausal_msgs::{Effect, Message, Service};
/// assert_eq!(Effect::type_name(), "roscausal_msgs/Effect");
/// assert_eq!(<Effect as Service>::Request::type_name(), "roscausal_msgs/EffectRequest");
/// ```
pub trait Service: Send + Sync + 'static {
    /// ROS package, such as `roscausal_msgs`.
    const PACKAGE: &'static str;
    /// Type name within the package, such as `WhatIf`.
    const NAME: &'static str;
    /// The question.
    type Request: Message;
    /// The answer.
    type Response: Message;

    /// `package/Name`.
    fn type_name() -> String {
        format!("{}/{}", Self::PACKAGE, Self::NAME)
    }

    /// The md5 by which both ends check in ROS 1 that they mean the same type: of the canonical texts of question and
    /// answer, one after the other.
    fn ros1_md5() -> String {
        let texts = [Self::Request::definition(), Self::Response::definition()];
        hex(&Md5::digest(texts.map(crate::Definition::ros1_md5_text).concat()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Effect, Explain, WhatIf};

    #[test]
    fn md5_are_those_of_ros1() {
        fn all<S: Service>() -> [String; 3] {
            [S::ros1_md5(), S::Request::ros1_md5().to_owned(), S::Response::ros1_md5().to_owned()]
        }
        // By the rule of ROS 1's own generator, genmsg, worked out apart from this program.
        let what_if = [
            "e54e0c2c0cc23711f8965e75a382516b",
            "64c828ea973ec2a1276c15e778a1f32c",
            "322676abd82722131b7034dea21efeb4",
        ];
        assert_eq!(all::<WhatIf>(), what_if);
        assert_eq!(Explain::ros1_md5(), "b2ee5cddaa2ed9254829d14cff997ea9");
        assert_eq!(crate::dynamic_reconfigure::Reconfigure::ros1_md5(), "bb125d226a21982a4a98760418dc2672");
        assert_eq!(Effect::ros1_md5(), "5f7c3b690496b304125f4fb6de8b3751");
    }
}
