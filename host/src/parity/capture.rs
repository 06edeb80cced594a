//! A vertex stage whose every vertex lands in a pixel of its own: a new entry point around the old
//! one hands its position on as one more varying, and places the vertex by its index. So positions
//! can be read back that no viewport would show.

use rspirv::binary::Assemble;
use rspirv::dr::{self, Builder, Operand};
use rspirv::spirv::{BuiltIn, Decoration, ExecutionModel, FunctionControl, Op, StorageClass, Word};

/// A rewritten module.
#[derive(Debug)]
pub struct Captured {
    /// Its words.
    pub words: Vec<u32>,
    /// Where the position comes out; behind it the clip distances, each at a location of its own.
    pub location: u32,
}

/// Rewrites `words` so that vertex `i` of its entry point `name` lands in pixel
/// `(i % width, i / width)` of a target of `width` x `height`, and is not clipped by any of its `clips` distances.
///
/// # Errors
/// In words: what is not as a vertex stage should be.
pub fn capture(
    words: &[u32],
    name: &str,
    [width, height]: [u32; 2],
    clips: u32,
) -> Result<Captured, String> {
    let module = dr::load_words(words).map_err(|e| format!("its SPIR-V cannot be read: {e}"))?;
    let entry = module
        .entry_points
        .iter()
        .position(|e| {
            e.operands.first() == Some(&Operand::ExecutionModel(ExecutionModel::Vertex))
                && e.operands.get(2) == Some(&Operand::LiteralString(name.into()))
        })
        .ok_or_else(|| format!("its SPIR-V has no vertex entry point `{name}`"))?;
    let interface: Vec<Word> = module.entry_points[entry].operands[3..]
        .iter()
        .filter_map(Operand::id_ref_any)
        .collect();
    let position = Position::of(&module, &interface).ok_or("it writes no position of its own")?;
    let location = 1 + module
        .annotations
        .iter()
        .filter_map(|i| match &i.operands[..] {
            [
                _,
                Operand::Decoration(Decoration::Location),
                Operand::LiteralBit32(n),
            ] => Some(*n),
            _ => None,
        })
        .max()
        .unwrap_or(0);
    let existing_index = decorated(&module, BuiltIn::VertexIndex);
    let distances = (clips > 0).then(|| Distances::of(&module, &interface));
    let distances = distances
        .map(|it| it.ok_or("it writes no clip distances"))
        .transpose()?;

    let mut b = Builder::new_from_module(module);
    let error = |e: dr::Error| format!("its SPIR-V cannot be extended: {e}");
    let void = b.type_void();
    let signature = b.type_function(void, []);
    let float = b.type_float(32, None);
    let uint = b.type_int(32, 0);
    let vec4 = b.type_vector(float, 4);
    let (out_vec4, out_float) = (
        b.type_pointer(None, StorageClass::Output, vec4),
        b.type_pointer(None, StorageClass::Output, float),
    );
    let passed = b.variable(out_vec4, None, StorageClass::Output, None);
    b.decorate(
        passed,
        Decoration::Location,
        [Operand::LiteralBit32(location)],
    );
    let passed_distances: Vec<Word> = (0..clips)
        .map(|i| {
            let distance = b.variable(out_float, None, StorageClass::Output, None);
            b.decorate(
                distance,
                Decoration::Location,
                [Operand::LiteralBit32(location + 1 + i)],
            );
            distance
        })
        .collect();
    let numbers: Vec<Word> = (0..clips).map(|i| b.constant_bit32(uint, i)).collect();
    // A block that holds the position holds the size too.
    let new_size = matches!(position, Position::Variable(_)).then(|| {
        let size = b.variable(out_float, None, StorageClass::Output, None);
        b.decorate(
            size,
            Decoration::BuiltIn,
            [Operand::BuiltIn(BuiltIn::PointSize)],
        );
        size
    });
    // A module declares a built-in only once; the old declaration may be signed.
    let (index, index_type) = match existing_index {
        Some(id) => (
            id,
            pointee(b.module_ref(), id).ok_or("its vertex index has no type")?,
        ),
        None => {
            let pointer = b.type_pointer(None, StorageClass::Input, uint);
            let id = b.variable(pointer, None, StorageClass::Input, None);
            b.decorate(
                id,
                Decoration::BuiltIn,
                [Operand::BuiltIn(BuiltIn::VertexIndex)],
            );
            (id, uint)
        }
    };
    let columns = b.constant_bit32(uint, width);
    let mut constant = |x: f32| b.constant_bit32(float, x.to_bits());
    let (zero, one, half) = (constant(0.0), constant(1.0), constant(0.5));
    let (right, up) = (constant(2.0 / width as f32), constant(-2.0 / height as f32));
    let (left, top) = (constant(-1.0), constant(1.0));

    let original = match b.module_ref().entry_points[entry].operands.get(1) {
        Some(Operand::IdRef(id)) => *id,
        _ => return Err("its entry point has no function".into()),
    };
    let outer = b
        .begin_function(void, None, FunctionControl::NONE, signature)
        .map_err(error)?;
    b.begin_block(None).map_err(error)?;
    b.function_call(void, None, original, []).map_err(error)?;
    let mut i = b.load(index_type, None, index, None, []).map_err(error)?;
    if index_type != uint {
        i = b.bitcast(uint, None, i).map_err(error)?;
    }
    let column = b.u_mod(uint, None, i, columns).map_err(error)?;
    let row = b.u_div(uint, None, i, columns).map_err(error)?;
    let mut place = |n: Word, scale: Word, start: Word| {
        let n = b.convert_u_to_f(float, None, n)?;
        let n = b.f_add(float, None, n, half)?;
        let n = b.f_mul(float, None, n, scale)?;
        b.f_add(float, None, n, start)
    };
    let x = place(column, right, left).map_err(error)?;
    let y = place(row, up, top).map_err(error)?;
    let at = b
        .composite_construct(vec4, None, [x, y, zero, one])
        .map_err(error)?;
    let (position, size) = match (position, new_size) {
        (Position::Member(block, [position, size]), _) => {
            let [position, size] = [position, size].map(|n| b.constant_bit32(uint, n));
            (
                b.access_chain(out_vec4, None, block, [position])
                    .map_err(error)?,
                b.access_chain(out_float, None, block, [size])
                    .map_err(error)?,
            )
        }
        (Position::Variable(id), Some(size)) => (id, size),
        (Position::Variable(_), None) => return Err("it has no size".into()),
    };
    let own = b.load(vec4, None, position, None, []).map_err(error)?;
    b.store(passed, own, None, []).map_err(error)?;
    b.store(position, at, None, []).map_err(error)?;
    b.store(size, one, None, []).map_err(error)?;
    for (passed, number) in passed_distances.iter().zip(numbers) {
        let (base, indices) = match distances {
            Some(Distances::Member(block, member)) => {
                (block, vec![b.constant_bit32(uint, member), number])
            }
            Some(Distances::Variable(variable)) => (variable, vec![number]),
            None => break,
        };
        let distance = b
            .access_chain(out_float, None, base, indices)
            .map_err(error)?;
        let own = b.load(float, None, distance, None, []).map_err(error)?;
        b.store(*passed, own, None, []).map_err(error)?;
        b.store(distance, one, None, []).map_err(error)?;
    }
    b.ret().map_err(error)?;
    b.end_function().map_err(error)?;

    let point = &mut b.module_mut().entry_points[entry];
    point.operands[1] = Operand::IdRef(outer);
    let added = [Some(passed), new_size].into_iter().flatten();
    point
        .operands
        .extend(added.chain(passed_distances).map(Operand::IdRef));
    if !interface.contains(&index) {
        point.operands.push(Operand::IdRef(index));
    }
    Ok(Captured {
        words: b.module().assemble(),
        location,
    })
}

/// Where a vertex stage writes its position.
enum Position {
    /// A variable.
    Variable(Word),
    /// A variable that is a block, and its members that are the position and the point's size, as
    /// compilers of GLSL write it.
    Member(Word, [u32; 2]),
}

impl Position {
    fn of(module: &dr::Module, interface: &[Word]) -> Option<Self> {
        if let Some(id) = decorated(module, BuiltIn::Position) {
            return interface.contains(&id).then_some(Self::Variable(id));
        }
        let (structure, position) = member(module, BuiltIn::Position)?;
        let (_, size) = member(module, BuiltIn::PointSize).filter(|(s, _)| *s == structure)?;
        let block = interface
            .iter()
            .find(|&&id| pointee(module, id) == Some(structure))?;
        Some(Self::Member(*block, [position, size]))
    }
}

/// Where a vertex stage writes its clip distances.
enum Distances {
    /// A variable, an array.
    Variable(Word),
    /// A variable that is a block, and its member that is the array.
    Member(Word, u32),
}

impl Distances {
    fn of(module: &dr::Module, interface: &[Word]) -> Option<Self> {
        if let Some(id) = decorated(module, BuiltIn::ClipDistance) {
            return interface.contains(&id).then_some(Self::Variable(id));
        }
        let (structure, number) = member(module, BuiltIn::ClipDistance)?;
        let block = interface
            .iter()
            .find(|&&id| pointee(module, id) == Some(structure))?;
        Some(Self::Member(*block, number))
    }
}

/// The structure with a member that is a built-in, and the member's number.
fn member(module: &dr::Module, built_in: BuiltIn) -> Option<(Word, u32)> {
    module
        .annotations
        .iter()
        .find_map(|i| match &i.operands[..] {
            [
                Operand::IdRef(structure),
                Operand::LiteralBit32(n),
                Operand::Decoration(Decoration::BuiltIn),
                Operand::BuiltIn(b),
            ] if i.class.opcode == Op::MemberDecorate && *b == built_in => Some((*structure, *n)),
            _ => None,
        })
}

/// The variable decorated as a built-in.
fn decorated(module: &dr::Module, built_in: BuiltIn) -> Option<Word> {
    module
        .annotations
        .iter()
        .find_map(|i| match &i.operands[..] {
            [
                Operand::IdRef(id),
                Operand::Decoration(Decoration::BuiltIn),
                Operand::BuiltIn(b),
            ] if i.class.opcode == Op::Decorate && *b == built_in => Some(*id),
            _ => None,
        })
}

/// The type that a variable points to.
fn pointee(module: &dr::Module, variable: Word) -> Option<Word> {
    let find = |id: Word| {
        module
            .types_global_values
            .iter()
            .find(move |i| i.result_id == Some(id))
    };
    let pointer = find(find(variable)?.result_type?)?;
    match pointer.operands.get(1) {
        Some(Operand::IdRef(id)) => Some(*id),
        _ => None,
    }
}
