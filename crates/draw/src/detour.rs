//! Ways around what stands on the paper: the shortest one with few bends and crossings, past the corners of boxes.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::geometry::{Area, Point, length, step};
use crate::paper::Paper;

/// Distances from a box at which a way may bend.
const OFF: [f64; 2] = [6.0, 13.0];
/// What a bend and a crossing cost, in px of length.
const BEND: f64 = 35.0;
const CROSSING: f64 = 45.0;
/// Most places for bends that are looked at.
const PLACES: usize = 1200;

/// The bends of a way between two points at the signs of these nodes; `None` if none was found.
pub fn detour(paper: &Paper, from: Point, to: Point, own: [usize; 2]) -> Option<Vec<Point>> {
    let window = |rim: f64| {
        let [low, high] = [f64::min, f64::max].map(|f| [f(from[0], to[0]), f(from[1], to[1])]);
        Area { min: low, max: high }.grown(rim)
    };
    [90.0, 350.0].into_iter().find_map(|rim| search(paper, from, to, own, window(rim)))
}

fn search(paper: &Paper, from: Point, to: Point, own: [usize; 2], window: Area) -> Option<Vec<Point>> {
    let mut places = vec![from, to];
    for area in paper.boxes_in(window) {
        let corners = OFF.into_iter().flat_map(|off| area.grown(off).corners());
        places.extend(corners.filter(|&p| !paper.covers(p)));
    }
    places.truncate(PLACES);
    let mut ways: Vec<(f64, usize, bool)> = vec![(f64::INFINITY, 0, false); places.len()];
    ways[0].0 = 0.0;
    let mut open = BinaryHeap::from([Open(length(step(from, to)), 0)]);
    while let Some(Open(_, here)) = open.pop() {
        if here == 1 {
            return Some(bends(&places, &ways));
        }
        if std::mem::replace(&mut ways[here].2, true) {
            continue;
        }
        let (so_far, p) = (ways[here].0, places[here]);
        for there in 1..places.len() {
            let q = places[there];
            let bend = if there == 1 { 0.0 } else { BEND };
            let cost = so_far + length(step(p, q)) + bend;
            if ways[there].2 || cost >= ways[there].0 || paper.blocked(p, q, own) {
                continue;
            }
            let cost = cost + CROSSING * paper.crossings(p, q) as f64;
            if cost < ways[there].0 {
                (ways[there].0, ways[there].1) = (cost, here);
                open.push(Open(cost + length(step(q, to)), there));
            }
        }
    }
    None
}

fn bends(places: &[Point], ways: &[(f64, usize, bool)]) -> Vec<Point> {
    let back = std::iter::successors(Some(ways[1].1), |&at| Some(ways[at].1)).take_while(|&at| at != 0);
    let mut bends: Vec<Point> = back.map(|at| places[at]).collect();
    bends.reverse();
    bends
}

/// A place to go on from, with the least that a way through it can cost.
struct Open(f64, usize);

impl Ord for Open {
    fn cmp(&self, other: &Open) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Open {
    fn eq(&self, other: &Open) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Open {}
