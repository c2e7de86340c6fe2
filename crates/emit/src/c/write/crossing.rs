//! Places for what is read where it is no variable: in another function, behind a loop, in a later turn of it.

use halfarrow_compiler::program::{Arg, Repetition};

use super::turns::{Operand, carried, first_definition, operand, operands};
use super::{Body, Place, Writer};

/// The place of a number that crosses.
pub(super) fn crossed(f: &Body, index: usize, local: usize) -> Place {
    Place { array: if f.wide[local] { "m->wide" } else { "m->w" }, index }
}

impl Writer<'_> {
    /// Finds where locals are computed, and places for those that cross.
    pub(super) fn find_places(&mut self, f: &mut Body, chunks: &[Vec<Repetition>]) {
        for (c, pieces) in chunks.iter().enumerate() {
            for piece in pieces {
                for at in piece.first..piece.end() {
                    for out in f.code.steps[at].defines() {
                        f.definition[out.0 as usize] = at;
                        f.home[out.0 as usize] = if piece.turns == 1 { c } else { usize::MAX };
                    }
                }
            }
        }
        let loops: Vec<Repetition> = chunks.iter().flatten().filter(|piece| piece.turns > 1).copied().collect();
        for (c, piece) in chunks.iter().enumerate().flat_map(|(c, pieces)| pieces.iter().map(move |piece| (c, piece))) {
            if piece.turns > 1 {
                self.find_carried(f, c, *piece);
            }
        }
        // Rows of what turns read of turns before them first, so that these follow each other.
        for &r in &loops {
            let steps = r.first..r.first + r.length;
            let chains = steps.flat_map(|at| operands(f.code, r, at)).filter_map(|args| chain(f, r, &args));
            let mut chains: Vec<(usize, usize)> = chains.collect();
            chains.sort_unstable();
            chains.into_iter().rev().for_each(|(at, lead)| self.row(f, r, at, lead));
        }
        for (c, pieces) in chunks.iter().enumerate() {
            f.chunk = c;
            for &piece in pieces {
                let steps = piece.first..piece.first + piece.length;
                for args in steps.flat_map(|at| operands(f.code, piece, at)) {
                    let how = if piece.turns > 1 { operand(f, piece, &args) } else { Operand::Same };
                    let (varying, of_turn) = (how == Operand::Varying, how == Operand::OfTurn);
                    let args = if varying { &args[..] } else { &args[..1] };
                    for local in
                        args.iter().filter_map(|a| if let Arg::Local(i) = a { Some(i.0 as usize) } else { None })
                    {
                        if varying || !of_turn && f.home[local] != c {
                            self.cross(f, &loops, local);
                        }
                    }
                }
            }
        }
    }

    fn cross(&mut self, f: &mut Body, loops: &[Repetition], local: usize) {
        if f.place[local] != usize::MAX {
            return;
        }
        let at = f.definition[local];
        let last = loops.partition_point(|r| r.first <= at).checked_sub(1);
        match last.map(|last| loops[last]).filter(|r| at < r.end()) {
            Some(r) => self.row(f, r, r.first + (at - r.first) % r.length, 0),
            None => self.take(f, &[local]),
        }
    }

    /// Values that go on from turn to turn are variables of their function, which hold those of the last turn behind the loop.
    fn find_carried(&self, f: &mut Body, chunk: usize, r: Repetition) {
        for local in carried(f, r).into_keys() {
            let last = f.code.steps[f.definition[local] + (r.turns - 1) * r.length].defines()[0].0 as usize;
            f.home[last] = chunk;
            f.last_of.insert(last, local);
        }
    }

    /// Places for what a step finds in all turns, one after the other, with what as many steps of its kind found before.
    fn row(&mut self, f: &mut Body, r: Repetition, at: usize, lead: usize) {
        let local = |at: usize| f.code.steps[at].defines()[0].0 as usize;
        if f.place[local(at)] != usize::MAX {
            return;
        }
        let alike = |other: usize| {
            let (a, b) = (local(at), other);
            f.place[b] == usize::MAX && f.wide[a] == f.wide[b] && f.moves[a] == f.moves[b]
        };
        let before = (1..=lead).rev().map(|turns| local(at - turns * r.length)).filter(|&other| alike(other));
        let row: Vec<usize> = before.chain((0..r.turns).map(|turn| local(at + turn * r.length))).collect();
        self.take(f, &row);
    }

    /// Takes places for locals of one kind.
    fn take(&mut self, f: &mut Body, locals: &[usize]) {
        let crossing = if f.wide[locals[0]] { &mut self.wide_crossing } else { &mut self.crossing };
        for &local in locals {
            f.place[local] = *crossing;
            *crossing += 1;
        }
        for &local in locals.iter().filter(|&&local| f.moves[local]) {
            f.rate_place[local] = *crossing;
            *crossing += 1;
        }
    }
}

/// The step of the first turn whose results turns read that come so many later, if an operand is such.
fn chain(f: &Body, r: Repetition, args: &[Arg]) -> Option<(usize, usize)> {
    let first = first_definition(f, r, args)?;
    let lead = r.first.checked_sub(first)?.div_ceil(r.length);
    (lead > 1 && lead < r.turns).then_some((first + lead * r.length, lead))
}
