//! fidget's side of stepwise peers: EXPRESSION WIDTH HEIGHT DEPTH THREADS FRAMES OUT M0 … M15.
//!
//! The file EXPRESSION is an implicit surface as fidget's text, M the matrix from its world to the scene,
//! row by row. Prints ns of each frame after the first as a line of JSON. Writes depths (u32) to OUT.

use fidget::context::Context;
use fidget::jit::JitShape;
use fidget::raster::voxel::{EvalConfig, RenderConfig, RenderSize, render};
use fidget::render::ThreadPool;
use fidget::shape::BoundShape;
use nalgebra::{Matrix4, Vector3};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let number = |i: usize| words[i].parse::<u32>();
    let (width, height, depth) = (number(2)?, number(3)?, number(4)?);
    let (threads, frames) = (number(5)? as usize, number(6)?);
    let values = words[8..].iter().map(|w| w.parse::<f32>());
    let matrix = Matrix4::from_row_slice(&values.collect::<Result<Vec<_>, _>>()?);

    let mut text = std::fs::File::open(&words[1])?;
    let (context, root) = Context::from_text(&mut text)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let pool = ThreadPool::Custom(pool);
    let threads = if threads > 1 { Some(&pool) } else { None };
    let evaluation = EvalConfig { threads, ..Default::default() };

    let mut ns = Vec::new();
    for frame in 0..=frames {
        let hair = Matrix4::new_translation(&(Vector3::repeat(1e-6) * frame as f32));
        let settings = RenderConfig {
            image_size: RenderSize::new(width, height, depth),
            world_to_model: hair * matrix,
        };
        let begun = Instant::now();
        let shape: BoundShape<_, f32> = JitShape::new(&context, root)?.try_into()?;
        let image = render(shape, &settings, &evaluation).ok_or("cancelled")?;
        ns.push(begun.elapsed().as_nanos());
        if frame == 0 {
            let depths = image.iter().flat_map(|pixel| pixel.depth.to_le_bytes());
            std::fs::write(&words[7], depths.collect::<Vec<u8>>())?;
        }
    }
    println!("{{\"ns\": {:?}}}", &ns[1..]);
    Ok(())
}
