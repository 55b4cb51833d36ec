//! The elements of an XML text as a tree, with their places. Time and memory are linear in the
//! length of the text, whatever its content (many attributes or namespaces make other validating
//! parsers quadratic).

use std::borrow::Cow;
use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::error::{Error, Name, Place};

/// All elements of a text, in the order of their start tags.
pub(super) struct Document<'x> {
    elements: Vec<Element<'x>>,
}

struct Element<'x> {
    start: BytesStart<'x>,
    /// The offset of its start tag.
    offset: usize,
    /// The range of its first text that is not blank.
    text: Range<usize>,
    children: Vec<usize>,
}

/// An element of a document.
#[derive(Clone, Copy)]
pub(super) struct Node<'d> {
    document: &'d Document<'d>,
    ix: usize,
}

impl<'x> Document<'x> {
    /// Parses `xml`, and stops after the start tag of an element `last`, if there is one.
    pub(super) fn parse(xml: &'x str, last: &str, name: Name) -> Result<Self, Error> {
        // The reader would skip one byte order mark without counting its bytes.
        let bare = xml.trim_start_matches('\u{feff}');
        let base = xml.len() - bare.len();
        let mut reader = Reader::from_str(bare);
        let mut elements: Vec<Element> = Vec::new();
        let mut open: Vec<usize> = Vec::new();
        // Offsets in a text in memory fit in usize.
        let at = |reader: &Reader<&[u8]>| base + reader.buffer_position() as usize;
        loop {
            let offset = at(&reader);
            let event = reader.read_event().map_err(|error| {
                let message = error.to_string().replace(['\n', '\r'], " ");
                name.syntax(
                    Place::Byte(base as u64 + reader.error_position()),
                    "well-formed XML",
                    message,
                )
            })?;
            match event {
                Event::Start(start) | Event::Empty(start) => {
                    let ix = elements.len();
                    let is_last = start.name().as_ref() == last;
                    let is_closed = xml[..at(&reader)].ends_with("/>");
                    if let Some(&parent) = open.last() {
                        elements[parent].children.push(ix);
                    }
                    elements.push(Element {
                        start,
                        offset,
                        text: 0..0,
                        children: Vec::new(),
                    });
                    if is_last && !is_closed {
                        break;
                    }
                    if !is_closed {
                        open.push(ix);
                    }
                }
                Event::End(_) => {
                    // The reader has checked that the end tag matches the element opened last.
                    open.pop();
                }
                Event::Text(_) => {
                    let range = offset..at(&reader);
                    if let Some(&element) = open.last()
                        && elements[element].text.is_empty()
                        && !xml[range.clone()].trim_ascii().is_empty()
                    {
                        elements[element].text = range;
                    }
                }
                Event::Eof if open.is_empty() => break,
                Event::Eof => {
                    let element = Node {
                        document: &Document { elements },
                        ix: open[open.len() - 1],
                    }
                    .tag()
                    .to_owned();
                    return Err(name.syntax(
                        Place::Byte(offset as u64),
                        format!("the end of the element '{element}'"),
                        "the end of the file",
                    ));
                }
                _ => {}
            }
        }
        Ok(Document { elements })
    }

    /// The first element.
    pub(super) fn root(&self) -> Option<Node<'_>> {
        (!self.elements.is_empty()).then_some(Node {
            document: self,
            ix: 0,
        })
    }
}

impl<'d> Node<'d> {
    fn element(self) -> &'d Element<'d> {
        &self.document.elements[self.ix]
    }

    /// The place of its start tag.
    pub(super) fn place(self) -> Place {
        Place::Byte(self.element().offset as u64)
    }

    pub(super) fn tag(self) -> &'d str {
        self.element().start.name().into_inner()
    }

    /// An attribute's value without unescaping; the attributes used here need no escapes.
    pub(super) fn attribute(self, key: &str) -> Option<&'d str> {
        let mut attributes = self.element().start.attributes();
        let found = attributes
            .with_checks(false)
            .flatten()
            .find(|attribute| attribute.key.as_ref() == key)?;
        match found.value {
            Cow::Borrowed(value) => Some(value),
            Cow::Owned(_) => None,
        }
    }

    /// The range of its first text that is not blank, in the parsed text.
    pub(super) fn text(self) -> Range<usize> {
        self.element().text.clone()
    }

    /// Its children with this tag.
    pub(super) fn children(self, tag: &str) -> impl Iterator<Item = Node<'d>> {
        let document = self.document;
        self.element()
            .children
            .iter()
            .map(move |&ix| Node { document, ix })
            .filter(move |child| child.tag() == tag)
    }

    /// Its first child with this tag.
    pub(super) fn child(self, tag: &str) -> Option<Node<'d>> {
        self.children(tag).next()
    }
}
