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

/// Where the line `---` of a `.srv` text begins.
const fn rule(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut at = 0;
    while !(bytes[at] == b'-' && bytes[at + 1] == b'-' && bytes[at + 2] == b'-' && bytes[at - 1] == b'\n') {
        at += 1;
    }
    at
}

/// What stands above the line `---` of a `.srv` text. A text without that line does not compile.
pub(crate) const fn question(text: &'static str) -> &'static str {
    text.split_at(rule(text)).0
}

/// What stands below it.
pub(crate) const fn answer(text: &'static str) -> &'static str {
    text.split_at(rule(text) + 4).1
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
        // of ROS 1's own generator, genmsg
        let what_if = [
            "85b37856441164bcc236d33d6c33e405",
            "180de493bcfd9807b9baa747cb9df93b",
            "815b45a6aa4f4058968f52c6013fdbde",
        ];
        assert_eq!(all::<WhatIf>(), what_if);
        assert_eq!(Explain::ros1_md5(), "b2ee5cddaa2ed9254829d14cff997ea9");
        assert_eq!(Effect::ros1_md5(), "5f7c3b690496b304125f4fb6de8b3751");
    }

    #[test]
    fn a_text_is_cut_at_its_rule() {
        let text = "string a # --- no rule\n---\nbool b\n";
        assert_eq!((question(text), answer(text)), ("string a # --- no rule\n", "bool b\n"));
    }
}
