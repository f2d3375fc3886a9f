//! The rules of a writer, field by field.

use robot_session::spec::{Configure, FieldVisitor};

use crate::program::{CommentRule, Rules};

impl Configure for Rules {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { name_limit, comment } = self;
        let about = "the longest program name; 8 on old controllers";
        fields.whole("name_limit", 0..=usize::MAX, "characters", about, name_limit);
        let choices = [("refuse", CommentRule::Refuse), ("truncate", CommentRule::Truncate)];
        fields.choice("comment", &choices, "how a comment that is too long is handled", comment);
    }
}
