#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/io/scratch_folder.hpp"

namespace twofold {

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

inline std::string content(const std::string& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Runs the program; `wrapper` goes before it on the command line.
inline Outcome run(const ScratchFolder& folder, const std::string& arguments,
                   const std::string& wrapper = "") {
  const std::string command = wrapper + " " + std::string(TWOFOLD_BINARY) + " " + arguments + " >'" +
                              (folder / "out") + "' 2>'" + (folder / "err") + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content(folder / "out"), content(folder / "err")};
}

inline void expect_bad_input(const Outcome& outcome, const std::string& part) {
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_NE(outcome.err.find(part), std::string::npos) << outcome.err;
}

}  // namespace twofold
