#pragma once

/// Words of the model file that are written in one place and checked in another.
namespace trammel::model_file {

inline constexpr int kFormat = 1;
/// How a bias with blocks fades beyond the domain: its kernel alone does.
inline constexpr const char* kFades = "kernel";

}  // namespace trammel::model_file
