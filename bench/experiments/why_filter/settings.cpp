#include "experiments/why_filter/settings.hpp"

#include <cmath>
#include <random>
#include <stdexcept>

namespace twofold::bench {

std::string setting_name(Setting setting) {
  switch (setting) {
    case Setting::kSideways:
      return "i";
    case Setting::kSidewaysPartial:
      return "ii";
    case Setting::kSidewaysRotation:
      return "iii";
    case Setting::kSharpTurn:
      return "iv";
  }
  return {};
}

std::vector<int> frame_counts(Setting setting) {
  if (setting == Setting::kSideways) return {1, 2, 4, 8, 16};
  if (setting == Setting::kSharpTurn) return {4, 8, 16};
  return {2, 4, 8, 16};
}

int iterations(Setting setting) {
  return setting == Setting::kSideways || setting == Setting::kSidewaysPartial ? 3 : 10;
}

Rig why_rig(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {500, 500, 319.5, 239.5, 640, 480};
  rig.baseline = 0.1;
  return rig;
}

namespace {

constexpr double kPi = 3.14159265358979323846;
// What a stream is for: the place of a point, its measurement before the start, at a time of the motion.
constexpr std::uint64_t kPlace = 0, kBefore = 1, kStart = 8;
constexpr int kFinest = 16;  // the largest M: frame i of M is frame 16 i / M of 16

/// World pose of the camera at s in [0, 1] along the motion; negative for the bootstrap frames.
SE3 camera_pose(Setting setting, double s) {
  switch (setting) {
    case Setting::kSideways:
      return {SO3(), Vector3(0.5 * s, 0, 0)};
    case Setting::kSidewaysPartial:
      return {SO3(), Vector3(1.1 * s, 0, 0)};
    case Setting::kSidewaysRotation:
      return {SO3::exp(Vector3(0, s * kPi / 6, 0)), Vector3(0.6 * s, 0, 0)};
    case Setting::kSharpTurn: {
      const double r = 0.6;  // forward, then around the corner to the right; straight before the start
      if (s < 0) return {SO3(), Vector3(0, 0, r * kPi / 2 * s)};
      const double a = s * kPi / 2;
      return {SO3::exp(Vector3(0, a, 0)), Vector3(r * (1 - std::cos(a)), 0, r * std::sin(a))};
    }
  }
  return {};
}

/// Step of the bootstrap frames in s; the turn needs more way because it moves along the optical axis.
double bootstrap_step(Setting setting) {
  return setting == Setting::kSidewaysPartial ? 0.1 : 0.2;
}

/// Random numbers that belong to a point, or to a point in a frame: cells of the M x N grid with the same
/// seed share them, so that their differences are not drowned by different scenes (SplitMix64).
class Stream {
 public:
  using result_type = std::uint64_t;
  Stream(std::uint64_t seed, std::uint64_t point, std::uint64_t frame)
      : state_((seed * 0x9E3779B97F4A7C15u + point) * 0xD1342543DE82EF95u + frame) {
    (*this)();
  }
  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~result_type{0}; }
  result_type operator()() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

/// Distance of the scene along the unit-depth ray `ray_w` from `origin_w`.
double scene_depth(Setting setting, const Vector3& origin_w, const Vector3& ray_w, Stream& rng) {
  std::uniform_real_distribution<double> unit(0, 1);
  if (setting == Setting::kSharpTurn) return 2 + 2 * unit(rng);  // walls all around
  const double z = setting == Setting::kSidewaysPartial ? 1.0 : 1.5;
  const double relief = 1 + 0.1 * (unit(rng) - 0.5);
  return (z * relief - origin_w.z()) / ray_w.z();
}

bool visible(const Rig& rig, const Vector3& x_c) {
  if (x_c.z() < 0.2) return false;
  const StereoPixel z = rig.project(x_c);
  if (!rig.camera.contains(z.head<2>())) return false;
  return rig.kind == SensorKind::kMono || z.z() >= 0;
}

}  // namespace

Block simulate_block(Setting setting, SensorKind kind, int frames, int points, unsigned seed) {
  Block block;
  block.rig = why_rig(kind);
  const bool mono = kind == SensorKind::kMono;
  for (int i = 0; i <= frames; ++i) {
    block.T_c_w.push_back(camera_pose(setting, static_cast<double>(i) / frames).inverse());
  }
  std::vector<SE3> before;  // b0, b1
  for (const int k : {2, 1}) {
    if (mono) before.push_back(camera_pose(setting, -k * bootstrap_step(setting)).inverse());
  }
  std::vector<Vector3> world;
  const auto draw = [&](int frame, const std::vector<SE3>& must_see) {
    const SE3 T_w_c = block.T_c_w[static_cast<std::size_t>(frame)].inverse();
    Stream rng(seed, world.size(), kPlace);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int attempt = 0; attempt < 100000; ++attempt) {
      const Vector2 uv(unit(rng) * 639, unit(rng) * 479);
      const Vector3 ray_c = block.rig.camera.unproject(uv);
      const Vector3 x_w =
          T_w_c * (ray_c * scene_depth(setting, T_w_c.translation(), T_w_c.so3() * ray_c, rng));
      bool all = visible(block.rig, block.T_c_w[static_cast<std::size_t>(frame)] * x_w);
      for (const SE3& T : must_see) all = all && visible(block.rig, T * x_w);
      if (all) return x_w;
    }
    throw std::runtime_error("setting " + setting_name(setting) + " has no common view");
  };
  const auto measure = [&](std::int64_t id, const SE3& T, std::uint64_t when) {
    Stream rng(seed, static_cast<std::uint64_t>(id), when);
    std::normal_distribution<double> noise(0, 0.5);
    const StereoPixel z = block.rig.project(T * world[static_cast<std::size_t>(id)]);
    return PointObservation{id, z + Vector3(noise(rng), noise(rng), noise(rng))};
  };
  const auto when = [frames](int frame) {
    return kStart + static_cast<std::uint64_t>(frame * kFinest / frames);
  };

  std::vector<SE3> start_views = before;
  start_views.push_back(block.T_c_w[1]);
  if (setting == Setting::kSideways) start_views.push_back(block.T_c_w.back());
  for (int j = 0; j < points; ++j) world.push_back(draw(0, start_views));
  std::vector<std::int64_t> alive;
  for (std::int64_t j = 0; j < points; ++j) alive.push_back(j);
  for (std::size_t b = 0; b < before.size(); ++b) {
    block.bootstrap.emplace_back();
    for (const std::int64_t id : alive) block.bootstrap.back().push_back(measure(id, before[b], kBefore + b));
  }
  for (const std::int64_t id : alive) block.first.push_back(measure(id, block.T_c_w[0], when(0)));
  for (int i = 1; i <= frames; ++i) {
    const SE3& T = block.T_c_w[static_cast<std::size_t>(i)];
    Block::Step step;
    std::vector<std::int64_t> still;
    for (const std::int64_t id : alive) {
      (visible(block.rig, T * world[static_cast<std::size_t>(id)]) ? still : step.lost).push_back(id);
    }
    for (std::size_t j = 0; j < step.lost.size(); ++j) {
      const auto id = static_cast<std::int64_t>(world.size());
      world.push_back(draw(i - 1, {T}));
      still.push_back(id);
      step.fresh.push_back(measure(id, block.T_c_w[static_cast<std::size_t>(i) - 1], when(i - 1)));
    }
    alive = still;
    for (const std::int64_t id : alive) step.current.push_back(measure(id, T, when(i)));
    block.steps.push_back(std::move(step));
  }
  return block;
}

}  // namespace twofold::bench
