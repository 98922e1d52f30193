#include "clients/cli/studies/study_tables.h"

#include <algorithm>

namespace trammel::cli {

namespace {

struct PrintedColumn {
  std::string_view study, set, model;
  PrintedFigures figures;
};

constexpr PrintedColumn kPrinted[] = {
    // Tables 5.6 and 5.7; 5.4 is their first column.
    {"cal", "training", "M0", {{4.191, -3.206, -3.868}, {4.500, 4.402, 3.742}, 9.797, 17.528}},
    {"cal", "training", "M1", {{-.001, .002, .000}, {1.955, 1.949, 2.922}, 4.003, 8.147}},
    {"cal", "training", "M2", {{-.001, .002, .000}, {1.706, 1.934, 2.700}, 3.718, 7.501}},
    {"cal", "training", "M3", {{-.001, .002, .000}, {.012, .013, .011}, .021, .040}},
    {"cal", "validation", "M0", {{3.912, -2.712, -4.118}, {4.354, 4.311, 3.988}, 9.644, 20.319}},
    {"cal", "validation", "M1", {{.103, .096, -.264}, {2.101, 2.227, 2.966}, 4.272, 9.842}},
    {"cal", "validation", "M2", {{.149, .044, -.189}, {1.910, 1.993, 2.731}, 3.889, 7.656}},
    {"cal", "validation", "M3", {{.000, .000, .000}, {.013, .013, .013}, .023, .057}},
    // Tables 5.8, 5.9 and 5.11, which has one column for all models.
    {"1dim", "training", "M0", {{3.077, 1.191, -9.927}, {4.142, .933, 1.676}, 11.405, 12.640}},
    {"1dim", "training", "M1", {{-.625, -.618, -3.676}, {3.089, .454, 1.480}, 5.109, 5.683}},
    {"1dim", "training", "M2", {{.232, -.608, -3.016}, {3.087, .544, 1.495}, 4.632, 4.889}},
    {"1dim", "training", "M0+GP", {{.000, .000, .000}, {.012, .013, .011}, .021, .043}},
    {"1dim", "training", "M1+GP", {{.000, .000, .000}, {.012, .013, .011}, .021, .043}},
    {"1dim", "training", "M2+GP", {{.000, .000, .000}, {.012, .013, .011}, .021, .043}},
    {"1dim", "validation", "M0", {{3.071, 1.190, -9.930}, {4.122, .928, 1.665}, 11.404, 12.653}},
    {"1dim", "validation", "M1", {{-.629, -.621, -3.679}, {3.074, .452, 1.470}, 5.109, 5.715}},
    {"1dim", "validation", "M2", {{.228, -.612, -3.018}, {3.072, .541, 1.485}, 4.632, 4.901}},
    {"1dim", "validation", "M0+GP", {{-.001, .003, -.001}, {.014, .014, .014}, .024, .059}},
    {"1dim", "validation", "M1+GP", {{-.001, .003, -.001}, {.014, .014, .014}, .024, .059}},
    {"1dim", "validation", "M2+GP", {{-.001, .003, -.001}, {.014, .014, .014}, .024, .059}},
    // Tables 5.12, 5.13, 5.15 and 5.16.
    {"3dim", "training", "M0", {{3.327, .598, -8.583}, {4.321, 3.066, 3.388}, 11.159, 17.295}},
    {"3dim", "training", "M1", {{-.585, -.592, -2.537}, {2.629, 1.226, 2.723}, 4.786, 6.001}},
    {"3dim", "training", "M2", {{.080, -.555, -1.998}, {2.547, 1.240, 2.751}, 4.455, 6.470}},
    {"3dim", "training", "M0+GP", {{.000, .000, .000}, {.030, .013, .035}, .048, .340}},
    {"3dim", "training", "M1+GP", {{.000, .000, .000}, {.029, .013, .035}, .047, .324}},
    {"3dim", "training", "M2+GP", {{.000, .000, .000}, {.029, .013, .035}, .048, .322}},
    {"3dim", "validation", "M0", {{3.220, .598, -8.533}, {4.288, 3.185, 3.529}, 11.157, 17.401}},
    {"3dim", "validation", "M1", {{-.690, -.595, -2.486}, {2.617, 1.260, 2.732}, 4.785, 6.065}},
    {"3dim", "validation", "M2", {{-.015, -.557, -1.944}, {2.529, 1.258, 2.801}, 4.461, 6.482}},
    {"3dim", "validation", "M0+GP", {{.000, .000, -.001}, {.051, .019, .056}, .078, .793}},
    {"3dim", "validation", "M1+GP", {{.000, .000, -.001}, {.051, .019, .055}, .077, .761}},
    {"3dim", "validation", "M2+GP", {{.000, .000, -.001}, {.051, .019, .055}, .077, .760}},
    // Tables 5.17, 5.18, 5.20 and 5.21.
    {"6dim-s", "training", "M0", {{2.426, 1.743, -10.927}, {2.795, 1.091, 1.425}, 11.804, 15.218}},
    {"6dim-s", "training", "M1", {{-1.416, -.609, -4.303}, {2.031, .393, 1.248}, 5.169, 6.179}},
    {"6dim-s", "training", "M2", {{-.622, -.690, -3.601}, {2.016, .357, 1.271}, 4.430, 5.805}},
    {"6dim-s", "training", "M0+GP", {{.000, .000, .000}, {.032, .012, .058}, .067, .427}},
    {"6dim-s", "training", "M1+GP", {{.000, .000, .000}, {.033, .013, .053}, .064, .429}},
    {"6dim-s", "training", "M2+GP", {{.000, .000, .000}, {.032, .013, .055}, .065, .420}},
    {"6dim-s",
     "validation",
     "M0",
     {{2.418, 1.749, -10.940}, {2.800, 1.091, 1.397}, 11.813, 15.114}},
    {"6dim-s", "validation", "M1", {{-1.428, -.605, -4.312}, {2.044, .402, 1.202}, 5.175, 6.189}},
    {"6dim-s", "validation", "M2", {{-.636, -.686, -3.612}, {2.023, .361, 1.225}, 4.432, 5.730}},
    {"6dim-s", "validation", "M0+GP", {{.002, .001, .001}, {.043, .017, .077}, .089, .568}},
    {"6dim-s", "validation", "M1+GP", {{.002, .000, .000}, {.044, .017, .075}, .088, .568}},
    {"6dim-s", "validation", "M2+GP", {{.002, .001, .001}, {.043, .017, .073}, .086, .571}},
    // Tables 5.22, 5.23, 5.25 and 5.26.
    {"6dim-l", "training", "M0", {{.723, 2.474, -7.962}, {3.274, 1.911, 3.065}, 9.683, 16.557}},
    {"6dim-l", "training", "M1", {{-2.286, -.578, -1.461}, {1.777, 1.243, 2.546}, 4.343, 6.400}},
    {"6dim-l", "training", "M2", {{-1.439, -.552, -.908}, {1.708, .996, 2.512}, 3.661, 5.848}},
    {"6dim-l", "training", "M0+GP", {{.000, .000, .000}, {.036, .013, .063}, .073, .421}},
    {"6dim-l", "training", "M1+GP", {{.000, .000, .000}, {.033, .012, .069}, .078, .430}},
    {"6dim-l", "training", "M2+GP", {{.000, .000, .000}, {.033, .012, .062}, .071, .426}},
    {"6dim-l", "validation", "M0", {{.818, 2.462, -7.918}, {3.317, 1.977, 3.076}, 9.684, 16.365}},
    {"6dim-l", "validation", "M1", {{-2.249, -.572, -1.392}, {1.803, 1.183, 2.597}, 4.325, 6.183}},
    {"6dim-l", "validation", "M2", {{-1.402, -.562, -.848}, {1.716, .967, 2.550}, 3.657, 5.820}},
    {"6dim-l", "validation", "M0+GP", {{-.002, .002, -.004}, {.087, .061, .122}, .162, 1.185}},
    {"6dim-l", "validation", "M1+GP", {{-.002, .000, -.004}, {.080, .051, .115}, .149, .764}},
    {"6dim-l", "validation", "M2+GP", {{.000, -.001, -.003}, {.078, .051, .112}, .146, .699}},
    // Tables 7.1 and 7.2, measured on the real robot.
    {"drilling", "training", "M0", {{1.174, 3.280, -.390}, {.663, .180, .092}, 3.584, 3.910}},
    {"drilling", "training", "M0+GP", {{.000, .000, .000}, {.046, .017, .027}, .056, .501}},
    {"drilling", "validation", "M0", {{1.185, 3.286, -.379}, {.685, .180, .092}, 3.584, 3.910}},
    {"drilling", "validation", "M0+GP", {{-.017, .000, .005}, {.090, .033, .050}, .108, .339}},
    {"drilling",
     "training without k = 1, 6",
     "M0",
     {{1.175, 3.288, -.379}, {.678, .180, .090}, 3.582, 3.910}},
    {"drilling",
     "training without k = 1, 6",
     "M0+GP",
     {{.000, .000, .000}, {.090, .033, .050}, .063, .501}},
    {"drilling",
     "validation without k = 1, 6",
     "M0",
     {{1.249, 3.271, -.384}, {.682, .163, .097}, 3.590, 3.906}},
    {"drilling",
     "validation without k = 1, 6",
     "M0+GP",
     {{-.010, .003, .002}, {.035, .030, .053}, .070, .115}},
};

struct AimedRow {
  std::string_view study, model;  // an empty model: every one with a learned bias
  int training_poses;             // 0: any
  Aim aim;
};

constexpr AimedRow kAims[] = {
    {"cal", "M0", 0, {9.5, 9.9}},       {"cal", "M3", 0, {0, .0237}},
    {"1dim", "", 0, {0, .0235}},        {"3dim", "", 0, {0, .025}},
    {"6dim-s", "", 0, {0, .025}},       {"6dim-l", "M2+GP", 0, {0, .040}},
    {"6dim-l", "M3+GP", 0, {0, .0245}}, {"quantity", "M2+GP", 400, {0, .060}},
};

struct PrintedParameter {
  std::string_view name;
  std::array<std::optional<double>, 3> identified;  // by M1, M2, M3; mm or 1e-3 rad
};

constexpr PrintedParameter kParameters[] = {
    {"gamma0", {{3.068, 3.068, 3.068}}},
    {"beta0", {{1.632, 1.833, 1.698}}},
    {"alpha0", {{1.828, 1.499, 1.702}}},
    {"x0", {{.633, .241, .493}}},
    {"y0", {{.648, .051, .507}}},
    {"z0", {{-3.806, -3.806, -3.806}}},
    {"d1", {{std::nullopt, -.112, 4.006}}},
    {"d3", {{std::nullopt, -.864, -.300}}},
    {"d4", {{std::nullopt, .954, -.300}}},
    {"d5", {{std::nullopt, .052, -.300}}},
    {"d6", {{std::nullopt, -.284, -.300}}},
    {"a1", {{std::nullopt, .573, -.300}}},
    {"a2", {{std::nullopt, -.493, -.300}}},
    {"a3", {{std::nullopt, -.959, -.300}}},
    {"a4", {{std::nullopt, .112, -.030}}},
    {"a5", {{std::nullopt, -.071, -.030}}},
    {"a6", {{std::nullopt, -.149, -.030}}},
    {"q1", {{std::nullopt, .509, .232}}},
    {"q2", {{std::nullopt, -1.551, -.520}}},
    {"q3", {{std::nullopt, .698, -.520}}},
    {"q4", {{std::nullopt, -.824, -.260}}},
    {"q5", {{std::nullopt, .177, -.260}}},
    {"q6", {{std::nullopt, .549, .100}}},
    {"alpha1", {{std::nullopt, -.0463, -.260}}},
    {"alpha2", {{std::nullopt, -.412, -.260}}},
    {"alpha3", {{std::nullopt, .420, -.260}}},
    {"alpha4", {{std::nullopt, -.517, .100}}},
    {"alpha5", {{std::nullopt, .877, .100}}},
    {"alpha6", {{std::nullopt, .0892, .100}}},
    {"beta2", {{std::nullopt, .488, .100}}},
};

bool is_length(std::string_view parameter) {
  return parameter.size() == 2 &&
         std::string_view("xyzda").find(parameter.front()) != std::string_view::npos;
}

}  // namespace

std::optional<PrintedFigures> printed_figures(std::string_view study, std::string_view set,
                                              std::string_view model) {
  const auto* found =
      std::find_if(std::begin(kPrinted), std::end(kPrinted), [&](const PrintedColumn& column) {
        return column.study == study && column.set == set && column.model == model;
      });
  return found == std::end(kPrinted) ? std::nullopt : std::optional(found->figures);
}

std::optional<Aim> aim_of(std::string_view study, std::string_view set, std::string_view model,
                          int training_poses) {
  if (set != "validation") return std::nullopt;
  const auto* found = std::find_if(std::begin(kAims), std::end(kAims), [&](const AimedRow& row) {
    return row.study == study &&
           (row.model.empty() ? model.ends_with("+GP") : row.model == model) &&
           (row.training_poses == 0 || row.training_poses == training_poses);
  });
  return found == std::end(kAims) ? std::nullopt : std::optional(found->aim);
}

std::optional<double> printed_parameter(std::string_view parameter, std::string_view model) {
  constexpr std::array<std::string_view, 3> kModels = {"M1", "M2", "M3"};
  const auto* row =
      std::find_if(std::begin(kParameters), std::end(kParameters),
                   [&](const PrintedParameter& printed) { return printed.name == parameter; });
  const auto* column = std::find(kModels.begin(), kModels.end(), model);
  if (row == std::end(kParameters) || column == kModels.end()) return std::nullopt;
  const std::optional<double> value =
      row->identified[static_cast<std::size_t>(column - kModels.begin())];
  if (!value || is_length(parameter)) return value;
  return 1e-3 * *value;
}

}  // namespace trammel::cli
