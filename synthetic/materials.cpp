#include "synthetic/materials.hpp"

#include <algorithm>
#include <cmath>

namespace twofold::synthetic {

void scatter_specks(Canvas& canvas, Random& random, double per_square_metre, double smallest, double largest,
                    float contrast) {
  const int count = static_cast<int>(per_square_metre * canvas.width() * canvas.height());
  cv::Mat& image = canvas.image();
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(0, canvas.width());
    const double y = random.uniform(0, canvas.height());
    // Sizes uniform in their logarithm: as much detail at each scale.
    const double r = smallest * std::pow(largest / smallest, random.uniform(0, 1));
    const int u = std::clamp(static_cast<int>(x / canvas.texel()), 0, image.cols - 1);
    const int v = std::clamp(static_cast<int>(y / canvas.texel()), 0, image.rows - 1);
    const float sign = random.chance(0.6) ? -1.0f : 1.0f;
    const float grey = image.at<float>(v, u) + sign * contrast * static_cast<float>(random.uniform(0.2, 1.0));
    const double angle = random.uniform(0, 180);
    const double minor = r * random.uniform(0.4, 1.0);
    canvas.ellipse(x, y, r, minor, angle, std::clamp(grey, 8.0f, 250.0f));
  }
}

void paint_bricks(Canvas& canvas, Random& random, double brick_width, double brick_height, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey + 45);
  const double joint = 0.13 * brick_height;
  int row = 0;
  for (double y = -random.uniform(0, brick_height); y < canvas.height(); y += brick_height, ++row) {
    double x = -brick_width * (row % 2 == 0 ? 0.1 : 0.6);
    while (x < canvas.width()) {
      const double w = brick_width * random.uniform(0.9, 1.1);
      canvas.rectangle(x, y, w - joint, brick_height - joint,
                       vary(random, grey, random.chance(0.12) ? 65 : 28));
      x += w;
    }
  }
  canvas.add_noise(random.word(), 14, 2.0, 0.02, 0.8f);
  scatter_specks(canvas, random, 16, 0.01, 0.05, 40);
}

void paint_ashlar(Canvas& canvas, Random& random, double stone, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey - 60);
  for (double y = -random.uniform(0, stone); y < canvas.height();) {
    const double h = stone * random.uniform(0.6, 1.3);
    for (double x = -random.uniform(0, stone); x < canvas.width();) {
      const double w = stone * random.uniform(0.8, 2.4);
      const double gap = 0.018;
      const float tone = vary(random, grey, 38);
      const auto jitter = [&] { return random.uniform(0, 0.03); };
      canvas.polygon({{x + jitter(), y + jitter()},
                      {x + w - gap - jitter(), y + jitter()},
                      {x + w - gap - jitter(), y + h - gap - jitter()},
                      {x + jitter(), y + h - gap - jitter()}},
                     tone);
      x += w;
    }
    y += h;
  }
  canvas.add_noise(random.word(), 16, 1.2, 0.012, 0.85f);
  scatter_specks(canvas, random, 19, 0.008, 0.05, 38);
}

void paint_plaster(Canvas& canvas, Random& random, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey);
  const double area = canvas.width() * canvas.height();
  for (int i = 0; i < static_cast<int>(0.5 * area); ++i) {  // repairs
    const double w = random.uniform(0.15, 0.9);
    const double h = random.uniform(0.15, 0.7);
    const double x = random.uniform(-0.2, canvas.width());
    const double y = random.uniform(-0.2, canvas.height());
    const float tone = vary(random, grey, 32);
    canvas.polygon({{x, y + random.uniform(0, 0.1)},
                    {x + w, y},
                    {x + w + random.uniform(-0.1, 0.1), y + h},
                    {x + 0.4 * w, y + h + random.uniform(-0.1, 0.1)},
                    {x + random.uniform(0, 0.1), y + h}},
                   tone);
  }
  canvas.add_noise(random.word(), 16, 2.4, 0.012, 0.82f);
  for (int i = 0; i < static_cast<int>(0.8 * area); ++i) {  // cracks
    double x = random.uniform(0, canvas.width());
    double y = random.uniform(0, canvas.height());
    double heading = random.uniform(0, 6.28);
    const float dark = grey - static_cast<float>(random.uniform(50, 90));
    for (int k = 0; k < 9; ++k) {
      heading += random.uniform(-0.8, 0.8);
      const double nx = x + 0.09 * std::cos(heading);
      const double ny = y + 0.09 * std::sin(heading);
      canvas.line(x, y, nx, ny, random.uniform(0.006, 0.016), dark);
      x = nx;
      y = ny;
    }
  }
  scatter_specks(canvas, random, 25, 0.008, 0.07, 42);
}

void paint_planks(Canvas& canvas, Random& random, double plank_width, float grey) {
  for (double x = 0; x < canvas.width(); x += plank_width) {
    for (double y = -random.uniform(0, 1.5); y < canvas.height();) {
      const double length = random.uniform(0.8, 2.2);
      canvas.rectangle(x, y, plank_width, length, vary(random, grey, 30));
      canvas.rectangle(x, y + length - 0.006, plank_width, 0.006, grey - 60);
      y += length;
    }
    canvas.rectangle(x, 0, std::max(0.05 * plank_width, canvas.texel()), canvas.height(), grey - 65);
  }
  const int grain = static_cast<int>(60 * canvas.width() * canvas.height() / plank_width * 0.1);
  for (int i = 0; i < grain; ++i) {
    const double x = random.uniform(0, canvas.width());
    const double y = random.uniform(0, canvas.height());
    const float tone = vary(random, grey - 25, 25);
    const double y1 = y + random.uniform(0.1, 0.5);
    canvas.line(x, y, x + random.uniform(-0.01, 0.01), y1, canvas.texel(), tone);
  }
  canvas.add_noise(random.word(), 10, 0.6, 0.006, 0.8f);
  scatter_specks(canvas, random, 3.0 / (plank_width * plank_width), 0.05 * plank_width, 0.25 * plank_width,
                 45);
}

void paint_paving(Canvas& canvas, Random& random, double slab, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey - 70);
  // Slabs of one or two units in a staggered grid, each of its own grey, a few broken.
  for (double y = 0; y < canvas.height(); y += slab) {
    for (double x = -random.uniform(0, slab); x < canvas.width();) {
      const double w = slab * (random.chance(0.4) ? random.uniform(1.2, 2.0) : random.uniform(0.6, 1.1));
      const auto j = [&] { return random.uniform(0.0, 0.025); };
      const float tone = vary(random, grey, 36);
      canvas.polygon({{x + j(), y + j()},
                      {x + w - 0.02 - j(), y + j()},
                      {x + w - 0.02 - j(), y + slab - 0.02 - j()},
                      {x + j(), y + slab - 0.02 - j()}},
                     tone);
      if (random.chance(0.3)) {
        const double at = x + w * random.uniform(0.2, 0.8);
        canvas.line(at, y, at + random.uniform(-0.2, 0.2), y + slab, 0.015, tone - 55);
      }
      x += w;
    }
  }
  canvas.add_noise(random.word(), 15, 3.0, 0.015, 0.85f);
  scatter_specks(canvas, random, 22, 0.012, 0.07, 48);
}

void paint_foliage(Canvas& canvas, Random& random, double leaf, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey - 45);
  const int count = static_cast<int>(1.2 * canvas.width() * canvas.height() / (leaf * leaf));
  for (int i = 0; i < count; ++i) {
    const double size = leaf * random.uniform(0.4, 1.1);
    // Later leaves lie on top and catch more light.
    const float light = -40 + 75 * static_cast<float>(i) / static_cast<float>(count);
    const float tone = vary(random, grey + light, 28);
    const double angle = random.uniform(0, 180);
    const double minor = size * random.uniform(0.3, 0.6);
    const double y = random.uniform(0, canvas.height());
    canvas.ellipse(random.uniform(0, canvas.width()), y, size, minor, angle, tone);
  }
  canvas.add_noise(random.word(), 14, 0.8, 0.1);
}

void paint_bark(Canvas& canvas, Random& random, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey);
  const int ridges = static_cast<int>(180 * canvas.width() * canvas.height());
  for (int i = 0; i < ridges; ++i) {
    const double x = random.uniform(0, canvas.width());
    const double y = random.uniform(0, canvas.height());
    const float tone = vary(random, grey, 50);
    const double width = random.uniform(0.008, 0.03);
    const double y1 = y + random.uniform(0.05, 0.3);
    canvas.line(x, y, x + random.uniform(-0.03, 0.03), y1, width, tone);
  }
  canvas.add_noise(random.word(), 14, 0.4, 0.012, 0.85f);
  scatter_specks(canvas, random, 33, 0.01, 0.04, 45);
}

void paint_metal(Canvas& canvas, Random& random, float grey) {
  canvas.rectangle(0, 0, canvas.width(), canvas.height(), grey);
  canvas.add_noise(random.word(), 18, 0.5 * canvas.height(), 4 * canvas.texel(), 0.75f);
  const double unit = std::min(canvas.width(), canvas.height());
  scatter_specks(canvas, random, 14 / (unit * unit), 0.01 * unit, 0.08 * unit, 45);
}

}  // namespace twofold::synthetic
