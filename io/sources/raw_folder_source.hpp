#pragma once

#include <filesystem>
#include <vector>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// Images as the camera took them, without calibration: a folder of images, one with left/ and right/, or a
/// recording of EuRoC layout (mav0/cam0/data, mav0/cam1/data, paired by file name; images without a partner
/// are left out, and reported). is_raw; time stamps are frame numbers.
class RawFolderSource final : public FrameSource {
 public:
  /// Throws IoError.
  explicit RawFolderSource(const std::filesystem::path& folder);

  [[nodiscard]] std::optional<std::int64_t> frame_count() const override;
  [[nodiscard]] bool is_raw() const override { return true; }
  [[nodiscard]] SourceReport report() const override;
  /// Where frame `index` came from, for messages.
  [[nodiscard]] const std::filesystem::path& file(std::size_t index) const { return pairs_[index].left; }

 private:
  struct Files {
    std::filesystem::path left, right;
  };
  bool read(Frame& frame) override;

  std::vector<Files> pairs_;
  std::size_t unpaired_ = 0;
  std::size_t next_ = 0;
};

}  // namespace twofold
