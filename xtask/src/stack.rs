//! The worst stack use, read from the image itself: what each function's instructions take from the
//! stack, who calls whom, and which interrupts may nest. A bound, not a measurement: every branch
//! counts as taken.
//!
//! A call through a pointer counts as a call of any function whose address the image holds. Where
//! calls may come round in a circle, each function of it counts once; the image has such circles
//! only through pointers, where no real call takes them.

mod thumb;

use crate::elf::Elf;
use crate::shell::Error;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use thumb::{Body, Code};

/// The bytes that the core puts on the stack for an interrupt, floating-point registers and
/// alignment included.
const EXCEPTION_FRAME: u32 = 108;
/// Entries of the vector table before the interrupts: stack pointer, reset, faults, SysTick.
const EXCEPTIONS: usize = 16;

/// The result of the analysis.
pub(crate) struct Stack {
    /// Bytes that the stack has.
    pub(crate) room: u32,
    /// Without interrupts: start-up and idling.
    thread: u32,
    /// Each interrupt's name and bytes, its frame included.
    interrupts: Vec<(String, u32)>,
    functions: usize,
    pointer_calls: usize,
    circles: usize,
    unbounded: Vec<String>,
}

impl Stack {
    /// Every interrupt on top of every other one, which their priorities allow once each.
    pub(crate) fn worst(&self) -> u32 {
        self.thread + self.interrupts.iter().map(|(_, bytes)| bytes).sum::<u32>()
    }
}

impl fmt::Display for Stack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "stack {} bytes of {} at worst, read from the image's instructions (not measured): {} functions, {} calls \
             through pointers taken for calls of any function whose address the image holds, circles of calls counted once: {}",
            self.worst(),
            self.room,
            self.functions,
            self.pointer_calls,
            self.circles
        )?;
        write!(f, "      start-up and idle {}", self.thread)?;
        for (name, bytes) in &self.interrupts {
            write!(f, ", {name} {bytes}")?;
        }
        writeln!(f)?;
        for name in &self.unbounded {
            writeln!(f, "      {name} takes an amount that its instructions do not tell")?;
        }
        Ok(())
    }
}

/// Analyses the image.
pub(crate) fn analyse(elf: &Elf) -> Result<Stack, Error> {
    let symbols = elf.symbols()?;
    let place = |name: &str| {
        symbols.iter().find(|symbol| symbol.name == name).map(|symbol| symbol.value).ok_or_else(|| {
            Error::new(format!("the image has no symbol {name}; build it with `cargo xtask firmware`"))
        })
    };
    let room = place("_stack_start")? - place("_stack_end")?;
    let mut names = BTreeMap::new();
    let mut sizes = BTreeMap::new();
    for symbol in symbols.iter().filter(|symbol| symbol.is_function) {
        let start = symbol.value & !1;
        names.entry(start).or_insert_with(|| symbol.name.clone());
        let size = sizes.entry(start).or_insert(0);
        *size = symbol.size.max(*size);
    }
    let code = Code::new(elf, &symbols)?;
    let bodies: BTreeMap<u32, Body> =
        sizes.iter().map(|(&start, &size)| (start, code.body(start, size))).collect();
    let taken = code.addresses_taken(&bodies);
    let graph = Graph::new(&bodies, &taken);

    let interrupts =
        symbols.iter().find(|symbol| symbol.name == "__INTERRUPTS").map_or(0, |table| table.size / 4);
    let vectors = code.vectors(EXCEPTIONS + interrupts as usize);
    let reset = vectors.get(1).copied().unwrap_or_default();
    let by_default = place("DefaultHandler")? & !1;
    let handlers: BTreeSet<u32> = vectors
        .iter()
        .skip(2)
        .copied()
        .filter(|handler| *handler != by_default && *handler != reset && bodies.contains_key(handler))
        .collect();
    let interrupts = handlers
        .into_iter()
        .map(|handler| {
            let name = names.get(&handler).cloned().unwrap_or_default();
            (name, graph.depth(handler) + EXCEPTION_FRAME)
        })
        .collect();
    Ok(Stack {
        room,
        thread: graph.depth(reset),
        interrupts,
        functions: bodies.len(),
        pointer_calls: bodies.values().map(|body| body.pointer_calls).sum(),
        circles: graph.circles,
        unbounded: bodies
            .iter()
            .filter(|(_, body)| body.takes_unknown)
            .map(|(start, _)| names.get(start).cloned().unwrap_or_default())
            .collect(),
    })
}

/// The graph of calls, each circle of it drawn together.
struct Graph {
    /// The circle, mostly of one, that each function belongs to.
    circle_of: BTreeMap<u32, usize>,
    /// The deepest stack from each circle on.
    depths: Vec<u32>,
    circles: usize,
}

/// Stands for "any function whose address is taken".
const POINTER: u32 = u32::MAX;

impl Graph {
    fn new(bodies: &BTreeMap<u32, Body>, taken: &BTreeSet<u32>) -> Self {
        let mut edges: BTreeMap<u32, Vec<u32>> = bodies
            .iter()
            .map(|(&start, body)| {
                let mut calls: Vec<u32> =
                    body.calls.iter().copied().filter(|c| bodies.contains_key(c)).collect();
                if body.pointer_calls > 0 {
                    calls.push(POINTER);
                }
                (start, calls)
            })
            .collect();
        edges.insert(POINTER, taken.iter().copied().collect());
        let frame = |node: &u32| bodies.get(node).map_or(0, |body| body.frame);

        let mut search = Search {
            edges: &edges,
            index: BTreeMap::new(),
            low: BTreeMap::new(),
            path: vec![],
            circles: vec![],
        };
        for &node in edges.keys() {
            search.visit(node);
        }
        // Circles come out callees first: every callee's depth is known when its caller's turn
        // comes.
        let mut circle_of = BTreeMap::new();
        for (number, circle) in search.circles.iter().enumerate() {
            circle_of.extend(circle.iter().map(|&node| (node, number)));
        }
        let mut depths: Vec<u32> = vec![];
        for (number, circle) in search.circles.iter().enumerate() {
            let own: u32 = circle.iter().map(frame).sum();
            let below = circle
                .iter()
                .flat_map(|node| &edges[node])
                .map(|callee| circle_of[callee])
                .filter(|&callee| callee != number)
                .map(|callee| depths[callee])
                .max()
                .unwrap_or(0);
            depths.push(own + below);
        }
        let circles = search.circles.iter().filter(|circle| circle.len() > 1).count();
        Self { circle_of, depths, circles }
    }

    fn depth(&self, function: u32) -> u32 {
        self.circle_of.get(&function).map_or(0, |&circle| self.depths[circle])
    }
}

/// Tarjan's search for strongly connected components.
struct Search<'a> {
    edges: &'a BTreeMap<u32, Vec<u32>>,
    index: BTreeMap<u32, usize>,
    low: BTreeMap<u32, usize>,
    path: Vec<u32>,
    circles: Vec<Vec<u32>>,
}

impl Search<'_> {
    fn visit(&mut self, node: u32) {
        if self.index.contains_key(&node) {
            return;
        }
        let own = self.index.len();
        self.index.insert(node, own);
        self.low.insert(node, own);
        self.path.push(node);
        for &callee in &self.edges[&node] {
            self.visit(callee);
            if self.path.contains(&callee) {
                let low = self.low[&callee].min(self.low[&node]);
                self.low.insert(node, low);
            }
        }
        if self.low[&node] == own {
            let from = self.path.iter().position(|&other| other == node).unwrap_or(0);
            self.circles.push(self.path.split_off(from));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(frame: u32, calls: &[u32], pointer_calls: usize) -> Body {
        Body { frame, calls: calls.to_vec(), pointer_calls, ..Body::default() }
    }

    #[test]
    fn the_deepest_path_counts() {
        let bodies = BTreeMap::from([
            (2, body(10, &[4, 6], 0)),
            (4, body(100, &[], 0)),
            (6, body(20, &[8], 0)),
            (8, body(50, &[], 0)),
        ]);
        let graph = Graph::new(&bodies, &BTreeSet::new());
        assert_eq!([2, 4, 6, 8].map(|f| graph.depth(f)), [110, 100, 70, 50]);
    }

    #[test]
    fn a_circle_counts_once_and_a_pointer_calls_whatever_is_taken() {
        let bodies = BTreeMap::from([
            (2, body(10, &[4], 0)),
            (4, body(20, &[2, 6], 0)),
            (6, body(1, &[], 1)),
            (8, body(1000, &[], 0)),
        ]);
        let graph = Graph::new(&bodies, &BTreeSet::from([8]));
        assert_eq!(graph.depth(2), 1031);
        assert_eq!(graph.depth(6), 1001);
        assert_eq!(graph.circles, 1);
    }
}
