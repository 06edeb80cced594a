/// A search tree's nearer child first, if both are met.
#[kernel(compute, threads(64))]
pub fn nearer(#[element] x: UVec2, #[storage] nodes: Buffer<'_, UVec2>) -> u32 {
    let mut sum = x.x & 1;
    let mut at = 0;
    while at < 9 {
        at += 1;
        let n = nodes.get(at);
        if n.x == 0 {
            let limit = 1.0_f32;
            let enter = |i: u32| {
                if i >= nodes.len() {
                    return None;
                }
                (i < 5).then_some((i, limit))
            };
            let (first, second) = match (enter(n.y), enter(n.y + 1)) {
                (Some(l), Some(r)) if l.1 <= r.1 => (Some(r), Some(l)),
                (l, r) => (l, r),
            };
            for child in [first, second].into_iter().flatten() {
                sum += child.0;
            }
        }
    }
    sum
}
