#include "io/sources/recorded_images.hpp"

#include <memory>

#include <fmt/format.h>

#include "io/files/image_file.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recording.hpp"

namespace twofold {
namespace fs = std::filesystem;

RecordedImages images_of_recording(const std::string& source, const std::optional<fs::path>& calibration) {
  const std::shared_ptr<const PlaybackSource> recording = open_recording(source, calibration);
  if (!recording) return {};
  return [recording](std::int64_t t_ns) { return recording->left_image(t_ns); };
}

RecordedImages images_being_recorded(const fs::path& folder) {
  return [data = folder / "mav0" / "cam0" / "data"](std::int64_t t_ns) {
    const fs::path file = data / fmt::format("{}.png", t_ns);
    return fs::exists(file) ? read_grey_image(file) : cv::Mat();
  };
}

}  // namespace twofold
