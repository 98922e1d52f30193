# trammel_embed(TARGET NAME FILE): the bytes of FILE as trammel::embedded::NAME (std::string_view, server/report/embedded.h),
# so that pages open anywhere without looking for anything.
function(trammel_embed target name file)
  file(READ ${file} EMBEDDED_TEXT)
  set(EMBEDDED_NAME ${name})
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/embedded_${name}.cpp)
  file(CONFIGURE OUTPUT ${generated} @ONLY CONTENT
"#include \"server/report/embedded.h\"

namespace trammel::embedded {
const std::string_view @EMBEDDED_NAME@ = R\"trammel(@EMBEDDED_TEXT@)trammel\";
}
")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  target_sources(${target} PRIVATE ${generated})
endfunction()

find_file(CHART_JS chart.min.js PATHS /usr/share/javascript/chart.js REQUIRED NO_DEFAULT_PATH
  DOC "Chart.js 3, minified (package libjs-chart.js)")
trammel_embed(trammel_report chart_js ${CHART_JS})
trammel_embed(trammel_report page_css ${CMAKE_CURRENT_SOURCE_DIR}/report/page.css)
trammel_embed(trammel_report view3d_js ${CMAKE_CURRENT_SOURCE_DIR}/report/view3d.js)
trammel_embed(trammel_report sort_tables_js ${CMAKE_CURRENT_SOURCE_DIR}/report/sort_tables.js)
trammel_embed(trammel_report model_page_html ${CMAKE_CURRENT_SOURCE_DIR}/report/model_page.html)
trammel_embed(trammel_report diagnosis_page_html ${CMAKE_CURRENT_SOURCE_DIR}/report/diagnosis_page.html)
trammel_embed(trammel_report history_page_html ${CMAKE_CURRENT_SOURCE_DIR}/report/history_page.html)
trammel_embed(trammel_report view_page_html ${CMAKE_CURRENT_SOURCE_DIR}/report/view_page.html)
