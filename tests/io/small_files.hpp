#pragma once

#include <sys/resource.h>

#include <csignal>

namespace twofold::testing {

/// A file may not grow beyond some bytes, while this is there.
class SmallFiles {
 public:
  explicit SmallFiles(rlim_t bytes) : before_(::signal(SIGXFSZ, SIG_IGN)) {
    (void)::getrlimit(RLIMIT_FSIZE, &limit_);
    const rlimit small{bytes, limit_.rlim_max};
    (void)::setrlimit(RLIMIT_FSIZE, &small);
  }
  SmallFiles(const SmallFiles&) = delete;
  ~SmallFiles() {
    (void)::setrlimit(RLIMIT_FSIZE, &limit_);
    (void)::signal(SIGXFSZ, before_);
  }

 private:
  rlimit limit_{};
  sighandler_t before_;
};

}  // namespace twofold::testing
