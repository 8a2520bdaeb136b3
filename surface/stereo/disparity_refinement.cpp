#include "surface/stereo/disparity_refinement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>

#include "base/check.hpp"
#include "base/median.hpp"
#include "base/right_of_way.hpp"
#include "surface/lanes.hpp"

namespace twofold {
namespace {

constexpr int kLevels = 3;           // of squares of 1, 2 and 4 pixels
constexpr int kRounds = 2;           // of warping
constexpr int kMargin = 8;           // around an image, so that windows and whole lanes may reach beyond
constexpr float kUnmatched = -1e6f;  // disparity of what has none: no window takes it in
constexpr float kFirstNoise = 3;     // standard deviation of the images' difference [grey levels]
constexpr float kShift = 0.15f;      // error of a warp that shows as a difference, too [px]
constexpr int kBrightness = 31;      // edge of the squares over which brightness is compared [px]
constexpr float kTogether =
    1;  // pixels of a square, and a window's from its plane, are no farther apart [px]

/// An image with a margin around it.
class Field {
 public:
  explicit Field(const cv::Size& size, float fill = 0)
      : values_(size.height + 2 * kMargin, size.width + 2 * kMargin + kLanes, CV_32FC1, cv::Scalar(fill)) {}
  [[nodiscard]] float* row(int y) { return values_.ptr<float>(y + kMargin) + kMargin; }
  [[nodiscard]] const float* row(int y) const { return values_.ptr<float>(y + kMargin) + kMargin; }
  [[nodiscard]] Lanes lane(int y, int x) const { return load<Lanes>(row(y) + x); }
  void set(int y, int x, const Lanes& lane) { std::memcpy(row(y) + x, &lane, sizeof(lane)); }
  [[nodiscard]] cv::Mat inner(const cv::Size& size) const {
    return values_(cv::Rect(kMargin, kMargin, size.width, size.height));
  }

 private:
  cv::Mat values_;
};

/// Squares of pixels, and the planes found around them.
///
/// What a square knows are sums over its pixels: information w g^2, pull w g e, squares w e^2 and count w,
/// where e is the difference of the images along the pixel's disparity, g its derivative by that, and w a
/// robust weight.
struct Level {
  Level(const cv::Size& cells, int edge)
      : size(cells),
        step(static_cast<float>(edge)),
        disparity(cells, kUnmatched),
        found(cells, kUnmatched),
        slope_x(cells),
        slope_y(cells),
        variance(cells),
        rest(cells),
        information(cells),
        pull(cells),
        squares(cells),
        count(cells) {}
  cv::Size size;
  float step;              ///< edge of a square [px]
  Field disparity, found;  ///< [px] before and after solving
  Field slope_x, slope_y;  ///< [px/px]
  Field variance;          ///< of the disparity [px^2]
  Field rest;  ///< mean squared difference that the plane leaves, over what noise and small shifts explain
  Field information, pull, squares, count;
};

/// How the windows of a level are solved.
struct WindowShape {
  int half = 4;      ///< of the edge, in squares
  float within = 1;  ///< of its plane lies what takes part [px]
  float bend =
      0.1f;  ///< standard deviation of surfaces from planes as large as the level above has them [px]
};
constexpr std::array<WindowShape, kLevels> kWindows{
    {{3, kTogether, 0.02f}, {4, kTogether, 0.05f}, {4, kTogether, 0.1f}}};
constexpr WindowShape kFirstWindow{2, 1.5f, 0.1f};  // of the coarsest level, before slopes are known

/// Where a window's plane is looked for, eight windows at once.
struct Expected {
  Lanes disparity, variance;  ///< [px, px^2]
  Lanes slope_x, slope_y;     ///< [px/px]
  Lanes slope_variance;
};

/// Equations of slope along x, slope along y and disparity, in eight windows at once.
struct Equations {
  std::array<std::array<Lanes, 3>, 3> A{};  ///< symmetric, lower half
  std::array<Lanes, 3> b{};

  /// A[2][2] becomes the information of x[2] with the others unknown, b[2] that times x[2].  (L D L^T)
  void eliminate() {
    for (std::size_t k = 0; k < 3; ++k) {
      const Lanes inverse = kOne / A[k][k];
      for (std::size_t i = k + 1; i < 3; ++i) {
        const Lanes l = A[i][k] * inverse;
        for (std::size_t j = k + 1; j <= i; ++j) A[i][j] -= l * A[j][k];
        b[i] -= l * b[k];
      }
    }
  }
  /// Then b becomes the solution x.
  void substitute() {
    for (std::size_t k = 3; k-- > 0;) {
      for (std::size_t i = k + 1; i < 3; ++i) b[k] -= A[i][k] * b[i];
      b[k] /= A[k][k];
    }
  }
};

/// What takes part in eight windows that lie side by side, relative to the disparities of their centres.
struct WindowSums {
  Equations equations;
  Lanes squares{}, count{};

  void add_row(const Level& level, const WindowShape& window, const Lanes& centre, const Expected& plane,
               int dy, int y, int x) {
    const float* d = level.disparity.row(y + dy) + x;
    const float* information = level.information.row(y + dy) + x;
    const float* pull = level.pull.row(y + dy) + x;
    const float* square = level.squares.row(y + dy) + x;
    const float* pixels = level.count.row(y + dy) + x;
    const float fy = level.step * static_cast<float>(dy);
    const Lanes row_plane = centre + plane.slope_y * fy;
    Lanes p{}, px{}, pxx{}, q{}, qx{};
    for (int dx = -window.half; dx <= window.half; ++dx) {
      const float fx = level.step * static_cast<float>(dx);
      const Lanes at = load<Lanes>(d + dx);
      const Lanes off = at - row_plane - plane.slope_x * fx;
      const LaneIndex in = (off < window.within) & (off > -window.within);
      const Lanes by = at - centre;
      const Lanes p_in = in ? load<Lanes>(information + dx) : kZero;
      const Lanes e_in = in ? load<Lanes>(pull + dx) : kZero;
      const Lanes q_in = in ? p_in * by - e_in : kZero;
      squares += in ? load<Lanes>(square + dx) + by * (q_in - e_in) : kZero;
      count += in ? load<Lanes>(pixels + dx) : kZero;
      p += p_in;
      px += p_in * fx;
      pxx += p_in * (fx * fx);
      q += q_in;
      qx += q_in * fx;
    }
    auto& [A, b] = equations;
    A[0][0] += pxx;
    A[1][0] += fy * px;
    A[1][1] += fy * fy * p;
    A[2][0] += px;
    A[2][1] += fy * p;
    A[2][2] += p;
    b[0] += qx;
    b[1] += fy * q;
    b[2] += q;
  }
};

/// Of four numbers side by side each one twice.
Lanes twice(const float* from) {
  using Four = float __attribute__((vector_size(4 * sizeof(float))));
  const auto four = load<Four>(from);
  return __builtin_shufflevector(four, four, 0, 0, 1, 1, 2, 2, 3, 3);
}

class Refiner {
 public:
  Refiner(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity)
      : size_(left.size()), difference_(size_, CV_32F), matched_(size_, CV_32F) {
    for (int edge = 1; edge < 1 << kLevels; edge *= 2)
      levels_.emplace_back(cv::Size((size_.width + edge - 1) / edge, (size_.height + edge - 1) / edge), edge);
    const auto smooth = [](const cv::Mat& from, cv::Mat& to) {
      from.convertTo(to, CV_32F);
      cv::GaussianBlur(to, to, {3, 3}, 0.7);
    };
    smooth(left, left_);
    smooth(right, right_);
    disparity.copyTo(levels_[0].disparity.inner(size_), disparity > 0);
  }

  void run() {
    right_ *= contrast();
    for (int round = 0; round < kRounds; ++round) {
      for (int y = 0; y < size_.height; ++y) {
        make_way();
        warp(y);
      }
      weigh();
      for (std::size_t k = 1; k < kLevels; ++k) gather(levels_[k - 1], levels_[k]);
      if (round == 0) solve(kFirstWindow, levels_.back(), nullptr);
      for (std::size_t k = kLevels; k-- > 0;)
        solve(kWindows[k], levels_[k], k + 1 < kLevels ? &levels_[k + 1] : nullptr);
      measure_noise();
    }
  }

  [[nodiscard]] cv::Mat result(double most_sigma) const {
    const auto most = static_cast<float>(most_sigma * most_sigma);
    cv::Mat result = cv::Mat::zeros(size_, CV_32FC1);
    const Level& pixels = levels_[0];
    for (int y = 0; y < size_.height; ++y) {
      const float *d = pixels.disparity.row(y), *variance = pixels.variance.row(y),
                  *rest = pixels.rest.row(y);
      auto* kept = result.ptr<float>(y);
      for (int x = 0; x < size_.width; ++x)
        if (d[x] > 0 && variance[x] <= most && rest[x] < kMostRest) kept[x] = d[x];
    }
    return result;
  }

 private:
  static constexpr int kSampleEvery = 4;      // pixels along rows and columns, for what holds everywhere
  static constexpr float kMostRest = 4;       // times what noise and small shifts explain
  static constexpr float kLeastCount = 8;     // pixels in a window
  static constexpr float kFirstSigma = 0.5f;  // of disparities and slopes that nothing is known of
  static constexpr float kFirstSlope = 0.1f;  // [px/px]
  static constexpr float kSlope = 0.03f;      // of slopes of the level above

  /// Of the left image over that of the right one, where they match.
  [[nodiscard]] double contrast() const {
    double n = 0, l = 0, r = 0, ll = 0, rr = 0;
    for (int y = 0; y < size_.height; y += kSampleEvery) {
      const float* d = levels_[0].disparity.row(y);
      for (int x = 0; x < size_.width; x += kSampleEvery) {
        const auto u = static_cast<int>(std::lround(static_cast<float>(x) - d[x]));
        if (d[x] <= 0 || u < 0) continue;
        const double at_l = left_.at<float>(y, x), at_r = right_.at<float>(y, u);
        n += 1;
        l += at_l;
        r += at_r;
        ll += at_l * at_l;
        rr += at_r * at_r;
      }
    }
    const double of_left = n * ll - l * l, of_right = n * rr - r * r;
    return of_left > 0 && of_right > 0 ? std::clamp(std::sqrt(of_left / of_right), 0.5, 2.0) : 1.0;
  }

  /// Difference and derivative along each pixel's own disparity; weigh() makes its information of the latter.
  void warp(int y) {
    Level& pixels = levels_[0];
    const auto* l = left_.ptr<float>(y);
    const auto* r = right_.ptr<float>(y);
    float* d = pixels.disparity.row(y);
    float* gradient = pixels.information.row(y);
    auto* difference = difference_.ptr<float>(y);
    auto* matched = matched_.ptr<float>(y);
    for (int x = 0; x < size_.width; ++x) {
      const float u = static_cast<float>(x) - d[x];
      gradient[x] = difference[x] = matched[x] = 0;
      if (d[x] <= 0 || u < 1 || u >= static_cast<float>(size_.width - 2)) {
        d[x] = kUnmatched;
        continue;
      }
      const int i = static_cast<int>(u);
      const float f = u - static_cast<float>(i);
      const float* p = r + i - 1;
      // Cubic through four samples (Keys, 1981), and its derivative.
      const float c1 = 0.5f * (p[2] - p[0]), c2 = p[0] - 2.5f * p[1] + 2 * p[2] - 0.5f * p[3],
                  c3 = 1.5f * (p[1] - p[2]) + 0.5f * (p[3] - p[0]);
      const int before = std::max(x - 1, 0), after = std::min(x + 1, size_.width - 1);
      const float left_slope = (l[after] - l[before]) / static_cast<float>(after - before);
      gradient[x] = 0.5f * (c1 + f * (2 * c2 + 3 * f * c3) + left_slope);
      difference[x] = l[x] - p[1] - f * (c1 + f * (c2 + f * c3));
      matched[x] = 1;
    }
  }

  /// Takes differences of brightness away, and sums up what each pixel knows.
  void weigh() {
    Level& pixels = levels_[0];
    cv::Mat sum, number;
    const cv::Size square(kBrightness, kBrightness);
    cv::boxFilter(difference_, sum, CV_32F, square, {-1, -1}, false);
    cv::boxFilter(matched_, number, CV_32F, square, {-1, -1}, false);
    const float noise = noise_ * noise_;
    for (int y = 0; y < size_.height; ++y) {
      const float *all = sum.ptr<float>(y), *n = number.ptr<float>(y);
      const float *difference = difference_.ptr<float>(y), *matched = matched_.ptr<float>(y);
      float *information = pixels.information.row(y), *pull = pixels.pull.row(y);
      float *squares = pixels.squares.row(y), *count = pixels.count.row(y);
      for (int x = 0; x < size_.width; ++x) {
        const float e = difference[x] - all[x] / std::max(n[x], 1.0f);
        const float g = information[x];
        const float w = matched[x] / (1 + e * e / (9 * (noise + kShift * kShift * g * g)));
        information[x] = w * g * g;
        pull[x] = w * g * e;
        squares[x] = w * e * e;
        count[x] = w;
      }
    }
  }

  /// Squares of a level from four of the finer one each, as far as these lie together.
  static void gather(const Level& fine, Level& coarse) {
    for (int y = 0; y < coarse.size.height; ++y) {
      for (int x = 0; x < coarse.size.width; ++x) {
        float first = kUnmatched, d = 0, weight = 0, information = 0, pull = 0, squares = 0, count = 0;
        for (int i = 0; i < 4; ++i) {
          const int fy = 2 * y + i / 2, fx = 2 * x + i % 2;
          const float at = fine.disparity.row(fy)[fx];
          if (first <= 0) first = at;
          if (at <= 0 || std::abs(at - first) > kTogether) continue;
          const float p = fine.information.row(fy)[fx];
          information += p;
          pull += fine.pull.row(fy)[fx];
          squares += fine.squares.row(fy)[fx];
          count += fine.count.row(fy)[fx];
          d += (p + 1) * at;
          weight += p + 1;
        }
        coarse.disparity.row(y)[x] = weight > 0 ? d / weight : kUnmatched;
        coarse.information.row(y)[x] = information;
        coarse.pull.row(y)[x] = pull;
        coarse.squares.row(y)[x] = squares;
        coarse.count.row(y)[x] = count;
      }
    }
  }

  void solve(const WindowShape& window, Level& level, const Level* above) const {
    for (int y = 0; y < level.size.height; ++y) {
      make_way();
      for (int x = 0; x < level.size.width; x += kLanes) solve(window, level, above, y, x);
    }
    std::swap(level.found, level.disparity);
  }

  void solve(const WindowShape& window, Level& level, const Level* above, int y, int x) const {
    const Lanes centre = level.disparity.lane(y, x);
    level.found.set(y, x, kZero + kUnmatched);
    if (!any(centre > 0)) return;
    const Expected expected =
        above != nullptr ? expected_from(*above, window, centre, y, x) : expected_from(level, centre, y, x);
    WindowSums sums;
    for (int dy = -window.half; dy <= window.half; ++dy)
      sums.add_row(level, window, centre, expected, dy, y, x);
    const Equations own = sums.equations;
    Equations& solved = sums.equations;
    take_expected(window, centre, expected, sums.count, solved);
    Lanes rest = sums.squares;
    for (std::size_t k = 0; k < 3; ++k) rest -= solved.b[k] * own.b[k];
    rest = larger(rest, kZero) / larger(sums.count - 3, kOne);
    const float noise = noise_ * noise_;
    const Lanes moved = solved.b[2];
    const LaneIndex good = (centre > 0) & (moved < 1) & (moved > -1) & (sums.count > kLeastCount);
    level.found.set(y, x, good ? centre + moved : kZero + kUnmatched);
    level.variance.set(y, x, larger(rest, kZero + noise) / solved.A[2][2]);
    level.rest.set(y, x, rest / (noise + kShift * kShift * own.A[2][2] / larger(sums.count, kOne)));
    level.slope_x.set(y, x, solved.b[0]);
    level.slope_y.set(y, x, solved.b[1]);
  }

  /// Nothing but the slopes that were found before.
  static Expected expected_from(const Level& level, const Lanes& centre, int y, int x) {
    return {centre, kZero + kFirstSigma * kFirstSigma, level.slope_x.lane(y, x), level.slope_y.lane(y, x),
            kZero + kFirstSlope * kFirstSlope};
  }
  /// The plane of the level above, where it lies near.
  static Expected expected_from(const Level& above, const WindowShape& window, const Lanes& centre, int y,
                                int x) {
    constexpr Lanes kSide{-1, 1, -1, 1, -1, 1, -1, 1};
    const float quarter = 0.25f * above.step;
    const float fy = y % 2 == 0 ? -quarter : quarter;
    const auto there = [&](const Field& field) { return twice(field.row(y / 2) + x / 2); };
    const Lanes a = there(above.slope_x), b = there(above.slope_y);
    const Lanes d = there(above.disparity) + a * (kSide * quarter) + b * fy;
    const LaneIndex fits = (d - centre < window.within) & (d - centre > -window.within);
    return {fits ? d : centre, fits ? there(above.variance) : kZero + kFirstSigma * kFirstSigma,
            fits ? a : kZero, fits ? b : kZero,
            fits ? kZero + kSlope * kSlope : kZero + kFirstSlope * kFirstSlope};
  }

  /// Adds what is expected, and solves. The disparity counts as far as the window's own agrees with it:
  /// surfaces need not be planes as large as the level above has them.
  void take_expected(const WindowShape& window, const Lanes& centre, const Expected& expected,
                     const Lanes& count, Equations& equations) const {
    constexpr float kGradientNoise =
        0.25f;                   // of the information of pixels without texture, in units of noise^2
    constexpr float kAgree = 4;  // variances
    constexpr Lanes kNone = kZero + 1e-3f;
    const Lanes noise = kZero + noise_ * noise_;
    auto& [A, b] = equations;
    const Lanes slope_weight = noise / expected.slope_variance;
    A[0][0] += slope_weight;
    A[1][1] += slope_weight;
    b[0] += slope_weight * expected.slope_x;
    b[1] += slope_weight * expected.slope_y;
    equations.eliminate();
    const Lanes apart = expected.disparity - centre - b[2] / larger(A[2][2], kNone);
    const Lanes own_variance = noise / larger(A[2][2] - count * noise * kGradientNoise, kNone);
    const Lanes bend = larger(apart * apart - kAgree * own_variance, kZero + window.bend * window.bend);
    const Lanes weight = noise / (expected.variance + bend);
    A[2][2] += weight;
    b[2] += weight * (expected.disparity - centre);
    equations.substitute();
  }

  /// The median window's.
  void measure_noise() {
    std::vector<float> rests;
    const Level& pixels = levels_[0];
    for (int y = 0; y < size_.height; y += kSampleEvery)
      for (int x = 0; x < size_.width; x += kSampleEvery)
        if (pixels.disparity.row(y)[x] > 0) rests.push_back(pixels.rest.row(y)[x]);
    if (rests.empty()) return;
    noise_ = std::max(noise_ * std::sqrt(median(std::span(rests))), 0.1f);
  }

  cv::Size size_;
  cv::Mat left_, right_;          // [grey levels], smoothed
  cv::Mat difference_, matched_;  // along each pixel's disparity; whether there is one
  std::vector<Level> levels_;     // the finest first
  float noise_ = kFirstNoise;
};

}  // namespace

cv::Mat refine_disparity(const cv::Mat& left, const cv::Mat& right, const cv::Mat& disparity,
                         double most_sigma) {
  TWOFOLD_CHECK(
      left.size() == right.size() && left.size() == disparity.size() && disparity.type() == CV_32FC1,
      "disparities of the images' size");
  Refiner refiner(left, right, disparity);
  refiner.run();
  return refiner.result(most_sigma);
}

}  // namespace twofold
