#pragma once

/// Words of the model file that are written in one place and checked in another.
namespace trammel::model_file {

/// The format that is written and read.
inline constexpr int kFormat = 2;
/// The way in which a bias with blocks fades beyond the domain: only its kernel fades.
inline constexpr const char* kFades = "kernel";
/// The angles on which causes of coupled joints depend, and which they turn: those of the gears
/// (server/robot/README.md).
inline constexpr const char* kAngles = "gears";

}  // namespace trammel::model_file
