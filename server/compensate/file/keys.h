#pragma once

/// Words of the model file that are written in one place and checked in another.
namespace trammel::model_file {

/// What is written and read.
inline constexpr int kFormat = 2;
/// How a bias with blocks fades beyond the domain: its kernel alone does.
inline constexpr const char* kFades = "kernel";
/// What causes of coupled joints are functions of, and turn: the angles of the gears
/// (server/robot/README.md).
inline constexpr const char* kAngles = "gears";

}  // namespace trammel::model_file
