#include "apps/twofold/run_failures.hpp"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/files/io_error.hpp"

namespace twofold {

void RunFailures::add(std::string what, ExitCode code) {
  all_.push_back(std::move(what));
  if (code_ != kBadInput) code_ = code;
}

void RunFailures::attempt(const std::function<void()>& step) {
  try {
    step();
  } catch (const WriteError& error) {
    add(error.what());
  } catch (const IoError& error) {
    add(error.what(), kBadInput);
  } catch (const std::exception& error) {
    add(error.what());
  }
}

std::string RunFailures::text() const {
  return fmt::format("{}", fmt::join(all_, "; "));
}

void RunFailures::expect_none() const {
  if (code_ == kBadInput) throw IoError(text());
  if (code_ != kOk) throw std::runtime_error(text());
}

}  // namespace twofold
