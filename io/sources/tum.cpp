#include <cmath>
#include <map>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/image_pairs.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMaxDifferenceNs = 20'000'000;  // as the benchmark's own association script
constexpr double kTumDepthUnit = 1.0 / 5000;  // the benchmark's depth images, where no file says otherwise

constexpr const char* kCameraText = "camera.txt";

/// Lines "time file".
std::vector<StampedFile> read_list(const fs::path& folder, const char* name) {
  const fs::path file = folder / name;
  std::vector<StampedFile> entries;
  std::int64_t previous = -1;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields.size() != 2) throw IoError(file, line.number, "is not 'time file'");
    entries.push_back({seconds_field(file, line.number, fields[0]), folder / fields[1]});
    expect_increasing(file, line.number, entries.back().t_ns, &previous);
  }
  return entries;
}

/// Lines "time rgb-file time depth-file".
std::vector<RecordedFrame> read_associations(const fs::path& folder) {
  const fs::path file = folder / "associations.txt";
  std::vector<RecordedFrame> frames;
  std::int64_t previous = -1;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields.size() != 4) throw IoError(file, line.number, "is not 'time rgb-file time depth-file'");
    // Some tools write depth first.
    const bool depth_first = fields[1].find("depth") != std::string_view::npos;
    const std::size_t rgb = depth_first ? 2 : 0;
    const std::size_t depth = depth_first ? 0 : 2;
    (void)seconds_field(file, line.number, fields[depth]);
    RecordedFrame frame{seconds_field(file, line.number, fields[rgb]),
                        folder / fields[rgb + 1],
                        {},
                        folder / fields[depth + 1]};
    expect_increasing(file, line.number, frame.t_ns, &previous);
    frames.push_back(std::move(frame));
  }
  return frames;
}

/// Pairs of a colour and a depth image, closest in time first; each image is used once; colour images without
/// a depth image are left out.
std::vector<RecordedFrame> associate(const std::vector<StampedFile>& rgb,
                                     const std::vector<StampedFile>& depth) {
  std::vector<RecordedFrame> frames;
  for (const auto& [c, d] : pairs_by_time(rgb, depth, kMaxDifferenceNs))
    frames.push_back({rgb[c].t_ns, rgb[c].file, {}, depth[d].file});
  return frames;
}

/// Lines "key value" (fx fy cx cy [width height depth_scale ...]), found beside some recordings of this
/// layout.
std::map<std::string, double> read_camera_text(const fs::path& file) {
  std::map<std::string, double> values;
  for (const TextLine& line : read_text_lines(file)) {
    const auto fields = split_fields(line.text);
    if (fields.size() != 2) throw IoError(file, line.number, "is not 'key value'");
    const std::string key(fields[0]);
    for (const char* known : {"fx", "fy", "cx", "cy", "width", "height", "fps", "depth_scale"})
      if (key == known) values[key] = number_field(file, line.number, fields[1]);
  }
  return values;
}

void take_depth_scale(const fs::path& file, const std::map<std::string, double>& values,
                      Calibration* calibration) {
  const auto scale = values.find("depth_scale");
  if (scale == values.end()) return;
  if (scale->second <= 0)
    throw IoError(file, fmt::format("key 'depth_scale' is {}, must be positive", scale->second));
  calibration->depth_unit = 1.0 / scale->second;
  calibration->depth_unit_stated = true;
}

void take_camera_text(const fs::path& file, Calibration* calibration) {
  const auto values = read_camera_text(file);
  const auto value_or = [&](const char* key, double otherwise) {
    const auto value = values.find(key);
    return value == values.end() ? otherwise : value->second;
  };
  PinholeCamera& camera = calibration->left.pinhole;
  for (const auto& [key, parameter] :
       {std::pair{"fx", &camera.fx}, {"fy", &camera.fy}, {"cx", &camera.cx}, {"cy", &camera.cy}}) {
    if (!values.contains(key)) throw IoError(file, fmt::format("key '{}' is missing", key));
    *parameter = values.at(key);
  }
  const double width = value_or("width", 0), height = value_or("height", 0);
  if (width < 0 || width > 1e5 || height < 0 || height > 1e5)
    throw IoError(file, "impossible width or height");
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  calibration->fps = value_or("fps", calibration->fps);
  take_depth_scale(file, values, calibration);
}

/// Most calibration files know of lenses only: then the folder's own files say what a unit of its depth
/// images is, else the benchmark does.
void find_depth_unit(const fs::path& folder, Calibration* calibration) {
  if (!calibration->depth_unit_stated && fs::exists(folder / "calibration.yaml")) {
    const Calibration beside = read_calibration(folder / "calibration.yaml");
    calibration->depth_unit_stated = beside.depth_unit_stated;
    calibration->depth_unit = beside.depth_unit;
  }
  if (!calibration->depth_unit_stated && fs::exists(folder / kCameraText))
    take_depth_scale(folder / kCameraText, read_camera_text(folder / kCameraText), calibration);
  if (!calibration->depth_unit_stated) calibration->depth_unit = kTumDepthUnit;
}

/// --calib, else calibration.yaml, else camera.txt, else parameters alone. `source` is what to name in
/// messages.
Calibration read_tum_calibration(const fs::path& folder, const std::optional<fs::path>& given,
                                 SourceParameters& parameters, fs::path* source) {
  Calibration base;
  bool from_file = true;
  if (given || fs::exists(folder / "calibration.yaml")) {
    *source = given.value_or(folder / "calibration.yaml");
    base = read_calibration(*source);
  } else if (fs::exists(folder / kCameraText)) {
    *source = folder / kCameraText;
    take_camera_text(*source, &base);
  } else {
    *source = parameters.subject();
    from_file = false;
  }
  find_depth_unit(folder, &base);
  return with_parameters(std::move(base), from_file, SensorKind::kRgbd, parameters);
}

}  // namespace

/// TUM RGB-D benchmark: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
Recording read_tum_recording(const fs::path& folder, const std::optional<fs::path>& calibration,
                             SourceParameters& parameters) {
  Recording recording;
  recording.folder = folder;
  const bool associated = fs::exists(folder / "associations.txt");
  if (associated) {
    recording.frames = read_associations(folder);
  } else if (parameters.left_only()) {
    for (const StampedFile& colour : read_list(folder, "rgb.txt"))
      recording.frames.push_back({colour.t_ns, colour.file, {}, {}});
  } else {
    recording.frames = associate(read_list(folder, "rgb.txt"), read_list(folder, "depth.txt"));
    if (recording.frames.empty()) throw IoError(folder, "no colour image has a depth image within 20 ms");
  }
  note_long_intervals(folder / (associated ? "associations.txt" : "rgb.txt"), recording);
  recording.calibration = read_tum_calibration(folder, calibration, parameters, &recording.calibration_file);
  if (const fs::path truth = folder / "groundtruth.txt"; fs::exists(truth)) {
    take_truth([&] { return read_tum_trajectory(truth); }, &recording);
  }
  return recording;
}

}  // namespace twofold
