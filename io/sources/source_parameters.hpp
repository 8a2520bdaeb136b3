#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace twofold {

/// A source as the user writes it: PATH[?key=value&...] or scheme:ARGUMENT[?key=value&...].
struct SourceSpec {
  std::string text;      ///< as given, for messages
  std::string scheme;    ///< empty for a bare path
  std::string argument;  ///< path, scene or device
  std::map<std::string, std::string> parameters;

  [[nodiscard]] bool is_camera() const {
    return scheme == "v4l2" || (scheme.empty() && argument.starts_with("/dev/"));
  }
};

/// Splits a source text. An existing path is never split. Throws IoError on a parameter without '=', an empty
/// or repeated key, or an empty argument.
[[nodiscard]] SourceSpec parse_source_spec(const std::string& text);

/// A part of a recording: its frames number first, first + 1, .., as many as `most` or as there are.
struct FrameRange {
  std::int64_t first = 0;
  std::int64_t most = std::numeric_limits<std::int64_t>::max();

  [[nodiscard]] bool is_whole() const { return first == 0 && most == FrameRange().most; }
  /// Throws IoError unless some of `count` frames are in it, or it is the whole.
  void expect_within(const std::string& subject, std::int64_t count) const;
};

/// Typed access to the parameters of a source that remembers what was asked for, so that a misspelt key is an
/// error.
class SourceParameters {
 public:
  /// subject names the source in messages.
  /// @param suppose_camera, left_only  as in SourceOptions
  SourceParameters(std::string subject, std::map<std::string, std::string> values,
                   bool suppose_camera = false, bool left_only = false)
      : subject_(std::move(subject)),
        values_(std::move(values)),
        suppose_camera_(suppose_camera),
        left_only_(left_only) {}

  /// Whether the user says something of the camera, which goes together with no half of what others say.
  [[nodiscard]] bool has_intrinsics() const {
    return values_.contains("fx") || values_.contains("fy") || values_.contains("cx") ||
           values_.contains("cy");
  }
  /// Value of the key, if given; throws IoError when it is not a finite number.
  [[nodiscard]] std::optional<double> take_number(const std::string& key);
  /// Throws IoError when it is not positive, too.
  [[nodiscard]] std::optional<double> take_positive(const std::string& key);
  [[nodiscard]] std::optional<std::string> take_text(const std::string& key);
  /// unpaired=drop: images without a partner are left out instead of refused. Throws IoError for other
  /// values.
  [[nodiscard]] bool take_drop_unpaired();
  /// max_gap in seconds: how far apart in time images of a pair may be. Throws IoError unless from 0 to 1.
  [[nodiscard]] std::int64_t take_max_gap_ns(double otherwise);
  /// first and frames. Throws IoError unless they are whole numbers, from 0 and from 1.
  [[nodiscard]] FrameRange take_range();
  /// Throws IoError when a key was given that nobody took.
  void expect_all_taken() const;

  [[nodiscard]] const std::string& subject() const { return subject_; }
  [[nodiscard]] bool suppose_camera() const { return suppose_camera_; }
  [[nodiscard]] bool left_only() const { return left_only_; }

 private:
  /// Throws IoError when it is given and not a whole number of at least `least`.
  [[nodiscard]] std::optional<std::int64_t> take_count(const std::string& key, std::int64_t least);

  std::string subject_;
  std::map<std::string, std::string> values_;
  bool suppose_camera_ = false;
  bool left_only_ = false;
};

}  // namespace twofold
