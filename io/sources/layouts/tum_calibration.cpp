#include "io/sources/layouts/tum_calibration.hpp"

#include <map>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/files/text_file.hpp"
#include "io/sources/layouts/icl_nuim.hpp"
#include "io/sources/layouts/published_cameras.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCameraText = "camera.txt";

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
/// images is, else the layout does.
void find_depth_unit(const fs::path& folder, double usual, Calibration* calibration) {
  if (!calibration->depth_unit_stated && fs::exists(folder / "calibration.yaml")) {
    const Calibration beside = read_calibration(folder / "calibration.yaml");
    calibration->depth_unit_stated = beside.depth_unit_stated;
    calibration->depth_unit = beside.depth_unit;
  }
  if (!calibration->depth_unit_stated && fs::exists(folder / kCameraText))
    take_depth_scale(folder / kCameraText, read_camera_text(folder / kCameraText), calibration);
  if (!calibration->depth_unit_stated) calibration->depth_unit = usual;
}

/// Of the dataset's own form; empty: there is none.
fs::path file_of_dataset(const fs::path& folder) {
  for (const char* name : {"calibration.txt", "sensors.yaml"})
    if (fs::exists(folder / name)) return folder / name;
  return {};
}

std::optional<PublicDataset> dataset_of(const fs::path& folder) {
  const auto dataset = dataset_by_name(folder);
  return !dataset && !icl_nuim_truth_file(folder).empty() ? PublicDataset::kIclNuim : dataset;
}

/// Nothing: neither a file nor a publication says it.
std::optional<Calibration> find_calibration(const std::optional<fs::path>& given,
                                            const SourceParameters& parameters, Recording* recording) {
  const fs::path& folder = recording->folder;
  fs::path& file = recording->calibration_file;
  if (given || fs::exists(folder / "calibration.yaml")) {
    file = given.value_or(folder / "calibration.yaml");
    return read_calibration(file);
  }
  if (fs::exists(folder / kCameraText)) {
    file = folder / kCameraText;
    Calibration calibration;
    take_camera_text(file, &calibration);
    return calibration;
  }
  file = parameters.subject();
  if (parameters.has_intrinsics()) return std::nullopt;
  if (const fs::path own = file_of_dataset(folder); !own.empty()) {
    file = own;
    return read_calibration(own);
  }
  const auto dataset = dataset_of(folder);
  if (!dataset || parameters.suppose_camera()) return std::nullopt;
  return take_published_camera(*dataset, recording);
}

}  // namespace

void take_tum_calibration(const std::optional<fs::path>& given, double usual_depth_unit,
                          SourceParameters& parameters, Recording* recording) {
  auto found = find_calibration(given, parameters, recording);
  const bool from_file = found.has_value();
  Calibration base = found.value_or(Calibration());
  find_depth_unit(recording->folder, usual_depth_unit, &base);
  recording->calibration = with_parameters(std::move(base), from_file, SensorKind::kRgbd, parameters);
}

}  // namespace twofold
