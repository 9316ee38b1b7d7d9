//! The Python literal in an array's header.

/// A value of the literal.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A quoted string.
    Text(String),
    /// Anything unquoted: a number, True, False.
    Word(String),
    /// A list or tuple.
    List(Vec<Value>),
    /// A dictionary with string keys.
    Dict(Vec<(String, Value)>),
}

impl Value {
    /// Parses a literal; `None` when it is none.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parser = Parser { rest: text };
        let value = parser.value(0)?;
        parser.rest.trim().is_empty().then_some(value)
    }

    /// Entry of a dictionary.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dict(entries) = self else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }
}

struct Parser<'t> {
    rest: &'t str,
}

impl Parser<'_> {
    fn eat(&mut self, token: char) -> Option<()> {
        self.rest = self.rest.trim_start().strip_prefix(token)?;
        Some(())
    }

    fn value(&mut self, depth: usize) -> Option<Value> {
        // No dtype nests deeper.
        if depth > 8 {
            return None;
        }
        self.rest = self.rest.trim_start();
        match self.rest.chars().next()? {
            quote @ ('\'' | '"') => {
                let (text, rest) = self.rest[1..].split_once(quote)?;
                let value = Value::Text(text.to_owned());
                self.rest = rest;
                Some(value)
            }
            '(' => self.sequence('(', ')', depth),
            '[' => self.sequence('[', ']', depth),
            '{' => self.dict(depth),
            _ => {
                let end = self
                    .rest
                    .find(|c: char| !(c.is_alphanumeric() || matches!(c, '-' | '+' | '.' | '_')))
                    .unwrap_or(self.rest.len());
                let (word, rest) = self.rest.split_at(end);
                let value = Value::Word(word.to_owned());
                self.rest = rest;
                (!word.is_empty()).then_some(value)
            }
        }
    }

    fn sequence(&mut self, open: char, close: char, depth: usize) -> Option<Value> {
        self.eat(open)?;
        let mut items = Vec::new();
        while self.eat(close).is_none() {
            items.push(self.value(depth + 1)?);
            if self.eat(',').is_none() {
                self.eat(close)?;
                break;
            }
        }
        Some(Value::List(items))
    }

    fn dict(&mut self, depth: usize) -> Option<Value> {
        self.eat('{')?;
        let mut entries = Vec::new();
        while self.eat('}').is_none() {
            let Value::Text(key) = self.value(depth + 1)? else { return None };
            self.eat(':')?;
            entries.push((key, self.value(depth + 1)?));
            if self.eat(',').is_none() {
                self.eat('}')?;
                break;
            }
        }
        Some(Value::Dict(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_that_numpy_writes_are_parsed() {
        let text = "{'descr': [('t', '<u8'), (('p', 'on'), '?')], 'fortran_order': False, 'shape': (3,), }   \n";
        let value = Value::parse(text);
        let value = value.as_ref();
        assert_eq!(
            value.and_then(|v| v.get("fortran_order")),
            Some(&Value::Word("False".to_owned()))
        );
        assert_eq!(
            value.and_then(|v| v.get("shape")),
            Some(&Value::List(vec![Value::Word("3".to_owned())]))
        );
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "{", "{'a'}", "(1,", "[[[[[[[[[[[[", "{'a': 1} 2", "'open"] {
            assert_eq!(Value::parse(text), None, "{text}");
        }
    }
}
