#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <utility>

/// Tables of the source's studies (chapters 5 and 7), and the values to reach. Units as printed.
namespace trammel::cli {

using RangesDeg = std::array<std::pair<double, double>, 6>;

/// One study of the bias on a range of joints, Table 5.3.
struct BiasStudy {
  std::string_view name;
  RangesDeg ranges;
  int training_poses;
};
inline constexpr RangesDeg kCalibrationRanges = {
    {{-170, 170}, {-65, 85}, {-180, 70}, {-300, 300}, {-120, 120}, {-180, 180}}};
inline constexpr int kCalibrationPoses = 120;
inline constexpr int kValidationPoses = 1000;
inline constexpr std::array<BiasStudy, 4> kBiasStudies = {{
    {"1dim", {{{5, 5}, {0, 0}, {-45, 45}, {0, 0}, {0, 0}, {0, 0}}}, 100},
    {"3dim", {{{-45, 45}, {-45, 45}, {-45, 45}, {0, 0}, {0, 0}, {0, 0}}}, 300},
    {"6dim-s", {{{-15, 15}, {-15, 15}, {-15, 30}, {-30, 30}, {-30, 30}, {-30, 30}}}, 800},
    {"6dim-l", {{{-40, 40}, {-15, 45}, {-15, 45}, {-80, 80}, {-90, 90}, {-80, 80}}}, 800},
}};
inline constexpr std::array<int, 6> kTrainingSizes = {50, 100, 200, 400, 800, 1600};
inline constexpr std::array<int, 5> kCalibrationSizes = {20, 40, 80, 120, 240};

/// A column of one of its tables.
struct PrintedFigures {
  std::array<double, 3> mean_mm, stddev_mm;
  double rms_mm, max_mm;
};
/// `study` as on the command line; `set` and `model` as in StudyRow. Empty: the source prints no
/// figures.
[[nodiscard]] std::optional<PrintedFigures> printed_figures(std::string_view study,
                                                            std::string_view set,
                                                            std::string_view model);

/// The rms that a row should have, mm.
struct Aim {
  double least_mm = 0, most_mm = 0;
};
/// `training_poses` tells the rows of a convergence study apart.
[[nodiscard]] std::optional<Aim> aim_of(std::string_view study, std::string_view set,
                                        std::string_view model, int training_poses);

/// Table 5.5 in mm and rad: the parameters identified by M1, M2 and M3. Empty where it prints none.
/// Its compliances are left out, because the rows are shifted against the true values in the same
/// table.
[[nodiscard]] std::optional<double> printed_parameter(std::string_view parameter,
                                                      std::string_view model);

}  // namespace trammel::cli
