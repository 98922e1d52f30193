#pragma once

#include <string>
#include <vector>

namespace trammel {

/// The first argument that turns a program of ours into a computing process.
inline constexpr const char* kComputeWord = "--compute";

/// The main() of the process that computes one job. It takes its task from the socket that
/// ChildProcess gave it, answers there, and ends when the other end does. It yields to all others:
/// it runs when the processor is idle enough, keeps its limits, is the first victim when memory
/// runs out, and does not outlive its parent. `arguments`: those that ChildProcess::start()
/// appended. Returns the exit code.
[[nodiscard]] int compute_main(const std::vector<std::string>& arguments);

}  // namespace trammel
