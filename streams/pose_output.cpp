#include "streams/pose_output.hpp"

#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "streams/line_reader.hpp"
#include "streams/network_outputs.hpp"
#include "streams/zmq_output.hpp"

namespace twofold {
namespace {

/// A file, a pipe or a terminal: one reader.
class FileOutput final : public PoseOutput {
 public:
  FileOutput(std::string name, FileDescriptor fd, PoseForm form)
      : name_(std::move(name)), reader_(std::move(fd), form) {}

  void offer(const std::string& lines) override { reader_.offer(lines); }
  void miss(std::uint64_t lines) override { reader_.miss(lines); }
  bool flush() override { return reader_.flush() || reader_.gone(); }
  [[nodiscard]] std::string problem() const override {
    const std::string why = reader_.problem();
    return why.empty() ? "" : name_ + ": " + why;
  }

 private:
  const std::string name_;
  LineReader reader_;
};

std::unique_ptr<PoseOutput> open_file(const std::string& path, PoseForm form) {
  // O_NONBLOCK: a named pipe that nobody reads is an error and not a wait.
  FileDescriptor fd(path == "-"
                        ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                        : ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NONBLOCK | O_CLOEXEC, 0666));
  if (!fd) {
    const char* why = errno == ENXIO ? "nobody reads this pipe" : std::strerror(errno);
    throw std::runtime_error(path + ": " + why);
  }
  return std::make_unique<FileOutput>(path == "-" ? "standard output" : path, std::move(fd), form);
}

}  // namespace

std::unique_ptr<PoseOutput> open_pose_output(const std::string& target, PoseForm form) {
  const auto after = [&](const char* scheme) { return target.substr(std::strlen(scheme)); };
  if (target.starts_with("udp:")) return open_udp(after("udp:"), form);
  if (target.starts_with("unix:")) return open_unix(after("unix:"), form);
  if (target.starts_with("zmq:")) return open_zmq(after("zmq:"), form);
  return open_file(target, form);
}

}  // namespace twofold
