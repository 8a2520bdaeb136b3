#pragma once

#include <algorithm>

#include "synthetic/canvas.hpp"

namespace twofold::synthetic {

/// Painters of surfaces. Each draws differently for each state of `random`, so that no two places of a scene
/// look alike. Sizes in metres.

void paint_bricks(Canvas& canvas, Random& random, double brick_width, double brick_height, float grey);
void paint_ashlar(Canvas& canvas, Random& random, double stone,
                  float grey);                                   ///< rows of stones of random sizes
void paint_plaster(Canvas& canvas, Random& random, float grey);  ///< blotches, cracks, stains, repairs
void paint_planks(Canvas& canvas, Random& random, double plank_width, float grey);
void paint_paving(Canvas& canvas, Random& random, double slab, float grey);
void paint_foliage(Canvas& canvas, Random& random, double leaf, float grey);
void paint_bark(Canvas& canvas, Random& random, float grey);
void paint_metal(Canvas& canvas, Random& random, float grey);

/// `grey` give or take `spread`, kept off black and white.
[[nodiscard]] inline float vary(Random& random, float grey, double spread) {
  return std::clamp(grey + static_cast<float>(random.uniform(-spread, spread)), 12.0f, 245.0f);
}

/// Blots of random size between `smallest` and `largest` radius, so many a square metre.
void scatter_specks(Canvas& canvas, Random& random, double per_square_metre, double smallest, double largest,
                    float contrast);

}  // namespace twofold::synthetic
