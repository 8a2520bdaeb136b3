#include "streams/pose_output.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "streams/line_reader.hpp"
#include "streams/network_outputs.hpp"
#include "streams/zmq_output.hpp"

namespace twofold {
namespace {

constexpr const char* kStandardOutput = "standard output";

/// "foo" of "foo:bar"; empty of a path. What looks like a scheme that was mistyped makes no file of that
/// name.
std::string scheme_of(const std::string& target) {
  const std::size_t end = target.find_first_of(":/");
  return end == std::string::npos || target[end] != ':' ? "" : target.substr(0, end);
}

/// A pipe with a name that nobody reads is an error and not a wait.
FileDescriptor open_for_writing(const std::string& path, int flags) {
  return FileDescriptor(::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | flags, 0666));
}

/// A file, a pipe or a terminal: one reader. A pipe with a name may have another one after him, who gets
/// lines from his coming on.
class FileOutput final : public PoseOutput {
 public:
  FileOutput(std::string name, FileDescriptor fd, PoseForm form)
      : name_(std::move(name)), form_(form), named_pipe_(is_named_pipe(fd)), reader_(std::move(fd), form) {}

  void offer(const std::string& lines) override {
    if (reader_.gone()) welcome();
    reader_.offer(lines);
    if (named_pipe_ && reader_.gone()) {  // he left since the line before: this one is for his successor
      welcome();
      if (!reader_.gone()) reader_.offer(lines);
    }
  }
  void miss(std::uint64_t lines) override { reader_.miss(lines); }
  bool flush() override { return reader_.flush() || reader_.gone(); }
  [[nodiscard]] std::string problem() const override {
    const std::string why = reader_.problem();
    return why.empty() ? "" : name_ + ": " + why;
  }

 private:
  [[nodiscard]] bool is_named_pipe(const FileDescriptor& fd) const {
    struct stat kind {};
    return name_ != kStandardOutput && ::fstat(fd.get(), &kind) == 0 && S_ISFIFO(kind.st_mode);
  }
  void welcome() {
    if (!named_pipe_) return;
    if (FileDescriptor fd = open_for_writing(name_, 0)) reader_ = LineReader(std::move(fd), form_);
  }

  const std::string name_;
  const PoseForm form_;
  const bool named_pipe_;
  LineReader reader_;
};

std::unique_ptr<PoseOutput> open_file(const std::string& path, PoseForm form) {
  FileDescriptor fd = path == "-" ? FileDescriptor(::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0))
                                  : open_for_writing(path, O_CREAT | O_TRUNC);
  if (!fd) {
    const char* why = errno == ENXIO ? "nobody reads this pipe" : std::strerror(errno);
    throw std::runtime_error(path + ": " + why);
  }
  return std::make_unique<FileOutput>(path == "-" ? kStandardOutput : path, std::move(fd), form);
}

}  // namespace

std::unique_ptr<PoseOutput> open_pose_output(const std::string& target, PoseForm form) {
  const auto after = [&](const char* scheme) { return target.substr(std::strlen(scheme)); };
  if (target.starts_with("udp:")) return open_udp(after("udp:"), form);
  if (target.starts_with("unix:")) return open_unix(after("unix:"), form);
  if (target.starts_with("zmq:")) return open_zmq(after("zmq:"), form);
  if (const std::string scheme = scheme_of(target); !scheme.empty())
    throw std::runtime_error(
        target + ": '" + scheme +
        ":' is none of udp:HOST:PORT, unix:PATH, zmq:ENDPOINT; a file of that name is ./" + target);
  return open_file(target, form);
}

}  // namespace twofold
