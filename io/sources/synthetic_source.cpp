#include "io/sources/synthetic_source.hpp"

#include <cmath>
#include <optional>

#include "io/files/io_error.hpp"
#include "io/sources/source_parameters.hpp"
#include "synthetic/scene_mesh.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

using synthetic::SyntheticOptions;
using synthetic::SyntheticSequence;

class SyntheticSource : public FrameSource {
 public:
  explicit SyntheticSource(const SyntheticOptions& options) : sequence_(options) {
    rig_ = sequence_.rig();
    for (int i = 0; i < sequence_.frame_count(); ++i)
      if (sequence_.in_first_place(i)) ground_truth_.push_back({sequence_.t_ns(i), sequence_.T_w_c(i)});
  }
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return sequence_.frame_count(); }
  [[nodiscard]] std::optional<TriangleMesh> true_surface() const override {
    return synthetic::mesh_of(sequence_.scene());
  }

 protected:
  bool read(Frame& frame) override {
    if (next_ == sequence_.frame_count()) return false;
    frame = sequence_.render(next_++);
    return true;
  }

 private:
  SyntheticSequence sequence_;
  int next_ = 0;
};

/// Whole number of a key; throws IoError for a fraction or one out of [0, 2^53].
std::optional<std::int64_t> take_integer(SourceParameters& parameters, const std::string& key) {
  const auto number = parameters.take_number(key);
  if (!number) return std::nullopt;
  if (*number != std::floor(*number) || *number < 0 || *number > 9007199254740992.0)
    throw IoError(parameters.subject(), "parameter " + key + " must be a whole number, 0 or more");
  return static_cast<std::int64_t>(*number);
}

void take_int(SourceParameters& parameters, const std::string& key, int* value) {
  const auto number = take_integer(parameters, key);
  if (!number) return;
  if (*number > 1'000'000'000) throw IoError(parameters.subject(), "parameter " + key + " is too large");
  *value = static_cast<int>(*number);
}

void take_switch(SourceParameters& parameters, const std::string& key, bool* value) {
  int number = *value ? 1 : 0;
  take_int(parameters, key, &number);
  if (number > 1) throw IoError(parameters.subject(), "parameter " + key + " must be 0 or 1");
  *value = number == 1;
}

void take(SourceParameters& parameters, const std::string& key, double* value) {
  if (const auto number = parameters.take_number(key)) *value = *number;
}

SensorKind sensor_of(const SourceParameters& parameters, const std::string& name) {
  if (name == "stereo") return SensorKind::kStereo;
  if (name == "rgbd") return SensorKind::kRgbd;
  if (name == "mono") return SensorKind::kMono;
  throw IoError(parameters.subject(), "parameter sensor='" + name + "' must be stereo, rgbd or mono");
}

SyntheticOptions parse(SourceParameters& parameters, SyntheticOptions options) {
  if (const auto sensor = parameters.take_text("sensor")) options.sensor = sensor_of(parameters, *sensor);
  const int usual_width = options.width;
  take_int(parameters, "width", &options.width);
  take_int(parameters, "height", &options.height);
  options.f *= static_cast<double>(options.width) / usual_width;
  for (const auto& [key, value] : {std::pair<const char*, double*>{"f", &options.f},
                                   {"f_error", &options.f_error},
                                   {"baseline", &options.baseline},
                                   {"fps", &options.fps},
                                   {"rounds", &options.rounds},
                                   {"noise", &options.noise},
                                   {"depth_noise", &options.depth_noise},
                                   {"depth_max", &options.depth_max},
                                   {"blur", &options.blur},
                                   {"shutter", &options.shutter},
                                   {"exposure", &options.exposure},
                                   {"exposure_steps", &options.exposure_steps},
                                   {"flicker", &options.flicker},
                                   {"flight", &options.flight},
                                   {"plain", &options.plain},
                                   {"drop", &options.drop},
                                   {"cover_at", &options.cover_at},
                                   {"cover", &options.cover},
                                   {"carried_to", &options.carried_to}})
    take(parameters, key, value);
  if (const auto readout = parameters.take_number("readout")) options.readout = *readout;
  take_int(parameters, "frames", &options.frames);
  if (const auto seed = take_integer(parameters, "seed")) options.seed = static_cast<std::uint64_t>(*seed);
  if (const auto seed = take_integer(parameters, "elsewhere"))
    options.elsewhere = static_cast<std::uint64_t>(*seed);
  take_int(parameters, "walkers", &options.walkers);
  take_int(parameters, "shape", &options.shape);
  take_int(parameters, "texture", &options.texture);
  take_int(parameters, "motion", &options.motion);
  take_switch(parameters, "object", &options.object);
  take_switch(parameters, "bare", &options.bare);
  parameters.expect_all_taken();
  return options;
}

}  // namespace

std::unique_ptr<FrameSource> open_synthetic(const std::string& scene,
                                            const std::map<std::string, std::string>& values) {
  SourceParameters parameters("synthetic:" + scene, values);
  try {
    return std::make_unique<SyntheticSource>(parse(parameters, synthetic::default_options(scene)));
  } catch (const std::invalid_argument& error) {
    throw IoError(parameters.subject(), error.what());
  }
}

}  // namespace twofold
