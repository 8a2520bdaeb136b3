#include "synthetic/wall_fixtures.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>

#include "synthetic/materials.hpp"

namespace twofold::synthetic {
namespace {

std::string random_letters(Random& random, int count) {
  std::string letters;
  for (int i = 0; i < count; ++i)
    letters += static_cast<char>(random.chance(0.15) ? ' ' : 'A' + random.below(26));
  return letters;
}

}  // namespace

void draw_window(Canvas& canvas, Random& random, double x, double y, double w, double h) {
  const float frame = vary(random, random.chance(0.5) ? 225 : 70, 20);
  canvas.rectangle(x - 0.08, y - 0.08, w + 0.16, h + 0.16, vary(random, 150, 60));  // reveal
  canvas.rectangle(x, y, w, h, frame);
  const int columns = 2 + random.below(2);
  const int rows = 2 + random.below(3);
  const double bar = 0.05;
  const double pane_w = (w - bar * (columns + 1)) / columns;
  const double pane_h = (h - bar * (rows + 1)) / rows;
  const float interior = vary(random, 48, 22);
  const bool curtain = random.chance(0.5);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const double px = x + bar + c * (pane_w + bar);
      const double py = y + bar + r * (pane_h + bar);
      canvas.rectangle(px, py, pane_w, pane_h, vary(random, interior, 14));
      if (curtain && (c == 0 || c == columns - 1)) {
        for (double s = 0; s < 0.6 * pane_w; s += 0.06)
          canvas.rectangle(c == 0 ? px + s : px + pane_w - s - 0.04, py, 0.04, pane_h, vary(random, 165, 35));
      } else if (random.chance(0.4)) {
        const float tone = vary(random, 120, 60);
        const double radius = random.uniform(0.05, 0.3) * pane_w;
        const double cy = py + random.uniform(0.5, 0.9) * pane_h;
        canvas.disc(px + random.uniform(0.2, 0.8) * pane_w, cy, radius, tone);
      }
    }
  }
  canvas.rectangle(x - 0.14, y + h + 0.04, w + 0.28, 0.09, vary(random, 190, 30));  // sill
  canvas.rectangle(x - 0.12, y + h + 0.13, w + 0.24, 0.04, 55);                     // its shadow
}

void draw_door(Canvas& canvas, Random& random, double x, double y, double w, double h) {
  canvas.rectangle(x - 0.12, y - 0.12, w + 0.24, h + 0.12, vary(random, 175, 45));
  const float leaf = vary(random, 95, 45);
  canvas.rectangle(x, y, w, h, leaf);
  const int rows = 2 + random.below(3);
  const int columns = 1 + random.below(2);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const double px = x + w * (c + 0.12) / columns;
      const double py = y + h * (r + 0.1) / rows;
      canvas.rectangle(px, py, 0.76 * w / columns, 0.8 * h / rows, leaf - 35);
      canvas.rectangle(px + 0.02, py + 0.02, 0.76 * w / columns - 0.04, 0.8 * h / rows - 0.04,
                       vary(random, leaf + 12, 14));
    }
  }
  canvas.disc(x + (random.chance(0.5) ? 0.1 : 0.9) * w, y + 0.53 * h, 0.035, 230);
  canvas.text(random_letters(random, 3), x + 0.3 * w, y + 0.2 * h, 0.1, 225);
}

void draw_poster(Canvas& canvas, Random& random, double x, double y, double w, double h) {
  const float paper = vary(random, random.chance(0.7) ? 215 : 60, 30);
  const float ink = paper > 128 ? 35.0f : 220.0f;
  canvas.rectangle(x - 0.02 * w, y - 0.02 * w, 1.04 * w, h + 0.04 * w, 40);
  canvas.rectangle(x, y, w, h, paper);
  for (int i = 0; i < 3 + random.below(6); ++i) {  // a picture of blocks, discs and wedges
    const double cx = x + w * random.uniform(0.15, 0.85);
    const double cy = y + h * random.uniform(0.12, 0.6);
    const double s = w * random.uniform(0.05, 0.14);
    const float tone = vary(random, 128, 110);
    switch (random.below(3)) {
      case 0:
        canvas.disc(cx, cy, s, tone);
        break;
      case 1:
        canvas.rectangle(cx - s, cy - 0.6 * s, 2 * s, 1.2 * s, tone);
        break;
      default:
        canvas.polygon({{cx - s, cy + s}, {cx + s, cy + s * random.uniform(0, 1)}, {cx, cy - s}}, tone);
    }
  }
  const double letter = w * random.uniform(0.06, 0.1);
  int lines = 2 + random.below(3);
  for (double ty = y + 0.7 * h; lines > 0 && ty < y + 0.97 * h; ty += 1.5 * letter, --lines)
    canvas.text(random_letters(random, 5 + random.below(4)), x + 0.08 * w, ty, letter, ink);
}

void draw_ivy(Canvas& canvas, Random& random, double x, double y, double radius) {
  const int leaves = static_cast<int>(500 * radius * radius);
  for (int i = 0; i < leaves; ++i) {
    const double angle = random.uniform(0, 6.2832);
    const double spread = radius * std::sqrt(random.uniform(0, 1));
    const double distance = spread * random.uniform(0.6, 1.0);
    const double size = random.uniform(0.03, 0.08);
    const float tone = vary(random, 85, 50);
    canvas.ellipse(x + distance * std::cos(angle), y + 1.4 * distance * std::sin(angle), size, 0.6 * size,
                   random.uniform(0, 180), tone);
  }
}

void PlainPanels::paint(Canvas& canvas, std::uint64_t wall) const {
  const int panels = std::max(1, static_cast<int>(std::lround(canvas.width() / kWidth)));
  const double first = unit_interval(counter_hash(seed, wall, 0));
  const auto plain_before = [&](int panel) { return std::floor(panel * share + first); };
  cv::Mat& image = canvas.image();
  for (int panel = 0; panel < panels; ++panel) {
    if (plain_before(panel + 1) == plain_before(panel)) continue;
    cv::Mat area = image.colRange(image.cols * panel / panels, image.cols * (panel + 1) / panels);
    area.setTo(cv::mean(area)[0]);
  }
}

void paint_facade(Canvas& canvas, Random& random, int style) {
  const auto grey = static_cast<float>(random.uniform(115, 165));
  switch (style) {
    case 0:
      paint_bricks(canvas, random, 0.27, 0.085, grey - 15);
      break;
    case 1:
      paint_ashlar(canvas, random, 0.34, grey);
      break;
    case 2:
      paint_plaster(canvas, random, grey + 15);
      break;
    default:
      paint_bricks(canvas, random, 0.42, 0.16, grey);
      break;
  }
  // Storeys of windows at uneven distances; the ground floor also has doors, posters and ivy.
  for (const double top : {0.7, 2.6}) {
    for (double x = random.uniform(0.5, 1.2); x < canvas.width() - 1.4;) {
      const double w = random.uniform(0.7, 1.25);
      const double h = random.uniform(1.0, 1.45);
      draw_window(canvas, random, x, top + random.uniform(-0.1, 0.1), w, h);
      x += w + random.uniform(0.7, 1.6);
    }
  }
  for (double x = random.uniform(0.4, 1.0); x < canvas.width() - 1.2;) {
    const double kind = random.uniform(0, 1);
    double w = random.uniform(0.5, 0.9);
    if (kind < 0.25) {
      w = random.uniform(0.9, 1.1);
      draw_door(canvas, random, x, canvas.height() - 2.1, w, 2.1);
    } else if (kind < 0.75) {
      const double h = w * random.uniform(1.1, 1.45);
      draw_poster(canvas, random, x, canvas.height() - random.uniform(1.9, 2.2), w, h);
    } else {
      draw_ivy(canvas, random, x + 0.4, canvas.height() - 0.9, random.uniform(0.4, 0.8));
    }
    x += w + random.uniform(0.35, 1.1);
  }
  canvas.shade_rows(canvas.height() - 0.6, canvas.height(), 1.0f, 0.7f);
  canvas.shade_rows(0, 0.4, 0.75f, 1.0f);
}

}  // namespace twofold::synthetic
