#include "tracking/fixed/fixed_pixels.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/option_check.hpp"
#include "imaging/byte_run.hpp"

namespace twofold {
namespace {

constexpr std::size_t kAllDead = 8192;  // of an image

ByteRun difference(ByteRun a, ByteRun b) {
  return larger(a, b) - smaller(a, b);
}

void store_run(ByteRun bytes, std::uint8_t* p) {
  std::memcpy(p, &bytes, sizeof bytes);
}

/// How many of the 3x3 pixels around bit x of row y are set.
int count_around(const std::array<std::uint32_t, kByteRun>& rows, int x, int y) {
  int count = 0;
  for (int row = std::max(y - 1, 0); row <= std::min(y + 1, kByteRun - 1); ++row) {
    const std::uint64_t bits = std::uint64_t{rows[static_cast<std::size_t>(row)]} << 1;
    count += std::popcount((bits >> x) & 7U);
  }
  return count;
}

}  // namespace

std::string FixedPixelOptions::invalid_reason() const {
  return OptionCheck()
      .above("min_motion_px", min_motion_px, 0)
      .within("same_grey", same_grey, 0, 254)
      .within("min_contrast", min_contrast, same_grey + 1, 254)
      .within("believed", believed, 2, 100)
      .above("look_period", look_period, 0)
      .share("max_fixed_share", max_fixed_share)
      .share("min_inlier_share", min_inlier_share)
      .within("aside_px", aside_px, 1, 32)
      .within("max_votes", max_votes, 1, 255 / std::max(believed, 1))
      .within("against", against, 1, 255)
      .within("min_in_quarter", min_in_quarter, 1, 256)
      .at_least("max_telling", max_telling, 1)
      .within("more_alone", more_alone, 0, (max_votes - 1) * believed)
      .within("touching", touching, 1, 9)
      .within("rest", rest, 0, 255)
      .within("chance", chance, 0, believed - 1)
      .share("chance_share", chance_share)
      .within("far_share", far_share, 0, 0.99)
      .at_least("nearer", nearer, 1)
      .reason();
}

FixedPixels::FixedPixels(int width, int height, const FixedPixelOptions& options) : options_(options) {
  static_assert(kSide == kByteRun, "a row of a block is a run");
  const int rim = options.aside_px;  // along the edge: what is compared with lies inside the image
  if (!options.enabled || std::min(width, height) < kSide + 2 * rim) return;
  columns_ = (width - 2 * rim + kSide - 1) / kSide;
  rows_ = (height - 2 * rim + kSide - 1) / kSide;
  blocks_.resize(static_cast<std::size_t>(columns_ * rows_));
  for (int i = 0; i < columns_ * rows_; ++i) {
    Block& block = blocks_[static_cast<std::size_t>(i)];
    // The last of a row or column overlaps the one before it.
    block.u = std::min(rim + i % columns_ * kSide, width - rim - kSide);
    block.v = std::min(rim + i / columns_ * kSide, height - rim - kSide);
  }
  dead_.reserve(kAllDead);
}

void FixedPixels::look_at(const cv::Mat& image, std::int64_t t_ns, ImageMotion& motion) {
  const double periods = 1e-9 * static_cast<double>(t_ns - last_ns_) / options_.look_period;
  last_ns_ = t_ns;
  const auto blocks = static_cast<double>(blocks_.size());
  const auto looks = static_cast<std::size_t>(std::ceil(std::clamp(periods, 0.0, 1.0) * blocks));
  for (std::size_t i = 0; i < looks; ++i) {
    Block& block = blocks_[next_];
    if (++next_ == blocks_.size()) next_ = 0;
    prefetch(image, blocks_[next_]);
    look_at_block(image, motion, block);
    if (next_ == 0) list_dead();
  }
}

/// Most of a look would be waiting for memory: nobody has touched the block since the look before.
void FixedPixels::prefetch(const cv::Mat& image, const Block& block) {
  if (block.rest > 0) return;
  constexpr int kLine = 64;  // bytes that come together
  for (int y = 0; y < kSide; ++y) __builtin_prefetch(image.ptr<std::uint8_t>(block.v + y) + block.u);
  for (std::size_t at = 0; at < block.before.size(); at += kLine) {
    __builtin_prefetch(&block.before[at]);
    __builtin_prefetch(&block.votes[at], 1);
  }
}

void FixedPixels::look_at_block(const cv::Mat& image, ImageMotion& motion, Block& block) {
  if (block.rest > 0) {
    --block.rest;
    return;
  }
  const auto moved = motion.least_since(block.taken, {block.u + kSide / 2, block.v + kSide / 2});
  if (moved && moved->norm() < options_.min_motion_px) return;
  if (moved) vote(image, *moved, block);
  for (int y = 0; y < kSide; ++y)
    std::memcpy(&block.before[static_cast<std::size_t>(y * kSide)],
                image.ptr<std::uint8_t>(block.v + y) + block.u, kSide);
  block.taken = motion.frame();
}

void FixedPixels::vote(const cv::Mat& image, const Vector2& motion_px, Block& block) {
  const Vector2 along = options_.aside_px * motion_px.normalized();
  const auto aside =
      static_cast<std::ptrdiff_t>(image.step) * std::lround(along.y()) + std::lround(along.x());
  const auto same = static_cast<std::uint8_t>(options_.same_grey);
  const auto believed = static_cast<std::uint8_t>(options_.believed);
  Rows fixed{}, telling{};
  ByteRun most{};
  int staying = 0, could_stay = 0;
  for (int y = 0; y < kSide; ++y) {
    const std::uint8_t* p = image.ptr<std::uint8_t>(block.v + y) + block.u;
    std::uint8_t* votes = &block.votes[static_cast<std::size_t>(y * kSide)];
    const ByteRun now = load_run(p);
    const ByteRun change = difference(now, load_run(&block.before[static_cast<std::size_t>(y * kSide)]));
    const ByteRun contrast =
        larger(difference(now, load_run(p + aside)), difference(now, load_run(p - aside)));
    const ByteRun tells = above(contrast, run_of(static_cast<std::uint8_t>(options_.min_contrast - 1)));
    const ByteRun stays = above(run_of(static_cast<std::uint8_t>(same + 1)), change) & tells;
    const ByteRun goes = above(change, run_of(same));
    ByteRun count = load_run(votes);
    count = count - smaller(count, goes & run_of(static_cast<std::uint8_t>(options_.against)));
    // A byte of `stays` is 255, which is -1; what is believed and more is enough.
    count = smaller(count - stays, run_of(static_cast<std::uint8_t>(options_.max_votes * believed)));
    store_run(count, votes);
    most = larger(most, count);
    staying += std::popcount(mask_of(stays));
    fixed[static_cast<std::size_t>(y)] =
        mask_of(above(count, run_of(static_cast<std::uint8_t>(believed - 1))));
    telling[static_cast<std::size_t>(y)] = mask_of(tells);
    could_stay += std::popcount(telling[static_cast<std::size_t>(y)]);
  }
  sum_up(fixed, telling, block);
  const bool shows_scene =
      mask_of(above(most, run_of(static_cast<std::uint8_t>(options_.chance)))) == 0 &&
      staying < std::max(static_cast<double>(options_.min_in_quarter), options_.chance_share * could_stay);
  block.rest = shows_scene ? static_cast<std::uint8_t>(options_.rest) : std::uint8_t{0};
}

/// What a block's votes come to.
void FixedPixels::sum_up(const Rows& fixed, const Rows& telling, Block& block) {
  covered_ -= std::popcount(block.covered);
  block.covered = 0;
  block.dead_count = 0;
  int all_fixed = 0;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const std::uint32_t half = quarter % 2 == 0 ? 0xffffU : 0xffff0000U;
    int count = 0, could_be = 0;
    for (int y = quarter / 2 * (kSide / 2); y < (quarter / 2 + 1) * (kSide / 2); ++y) {
      count += std::popcount(fixed[static_cast<std::size_t>(y)] & half);
      could_be += std::popcount(telling[static_cast<std::size_t>(y)] & half);
    }
    if (count >= options_.min_in_quarter && could_be <= options_.max_telling * count)
      block.covered = static_cast<std::uint8_t>(block.covered | 1U << quarter);
    all_fixed += count;
  }
  covered_ += std::popcount(block.covered);
  block.has_fixed = all_fixed > 0;
  if (all_fixed > static_cast<int>(kMostDead)) return;
  for (int y = 0; y < kSide; ++y) {
    for (std::uint32_t left = fixed[static_cast<std::size_t>(y)]; left != 0; left &= left - 1) {
      const int x = std::countr_zero(left);
      if (count_around(fixed, x, y) >= options_.touching) continue;
      if (block.votes[static_cast<std::size_t>(y * kSide + x)] < options_.believed + options_.more_alone)
        continue;
      block.dead[block.dead_count++] = static_cast<std::uint16_t>(y * kSide + x);
    }
  }
}

void FixedPixels::list_dead() {
  dead_.clear();
  for (const Block& block : blocks_) {
    for (std::size_t i = 0; i < block.dead_count && dead_.size() < dead_.capacity(); ++i)
      dead_.emplace_back(block.u + block.dead[i] % kSide, block.v + block.dead[i] / kSide);
  }
}

const FixedPixels::Block* FixedPixels::block_at(int u, int v) const {
  const int rim = options_.aside_px;
  const int column = (u - rim) / kSide, row = (v - rim) / kSide;
  if (u < rim || v < rim || column >= columns_ || row >= rows_) return nullptr;
  const Block& block = blocks_[static_cast<std::size_t>(row * columns_ + column)];
  return u < block.u + kSide && v < block.v + kSide ? &block : nullptr;
}

bool FixedPixels::covers(const Vector2& uv) const {
  if (covered_ == 0 || !is_believable()) return false;
  const int u = static_cast<int>(uv.x()), v = static_cast<int>(uv.y());
  const Block* block = block_at(u, v);
  if (block == nullptr) return false;
  const int quarter = (v - block->v) / (kSide / 2) * 2 + (u - block->u) / (kSide / 2);
  return (block->covered >> quarter & 1) != 0;
}

bool FixedPixels::touches(const Eigen::Vector2f& uv, int level) const {
  if (blocks_.empty() || !is_believable()) return false;
  const int u0 = static_cast<int>(uv.x()), v0 = static_cast<int>(uv.y()), step = 1 << level;
  // Most corners are nowhere near; a patch of the levels that points are started on is smaller than a block.
  const auto has_fixed = [&](int dx, int dy) {
    const Block* block = block_at(u0 + dx * step, v0 + dy * step);
    return block != nullptr && block->has_fixed;
  };
  if (!has_fixed(-2, -2) && !has_fixed(2, -2) && !has_fixed(-2, 2) && !has_fixed(2, 2)) return false;
  int fixed = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      const int u = u0 + dx * step, v = v0 + dy * step;
      const Block* block = block_at(u, v);
      if (block == nullptr) continue;
      const auto at = static_cast<std::size_t>((v - block->v) * kSide + u - block->u);
      fixed += block->votes[at] >= options_.believed ? 1 : 0;
    }
  }
  return fixed >= options_.touching;
}

}  // namespace twofold
