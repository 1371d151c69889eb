# `cmake --workflow --preset demo`, or the target `demo`: fits a real molecule and says what it does.
set(OVOID_DEMO_MOLECULE /usr/share/apbs/examples/misc/fas2.pqr CACHE FILEPATH
  "Molecule of the target demo (this one comes with Debian's package apbs-data)")
# Short names for the reader, where the build is in the source folder.
cmake_path(RELATIVE_PATH PROJECT_BINARY_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR}
  OUTPUT_VARIABLE demo_build)
if(demo_build MATCHES "^\\.\\.")
  set(demo_build ${PROJECT_BINARY_DIR})
endif()
add_custom_target(demo
  COMMAND sh cmake/demo.sh ${demo_build}/ovoid ${OVOID_DEMO_MOLECULE} ${demo_build}
  DEPENDS ovoid_tool
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
  USES_TERMINAL VERBATIM
  COMMENT "Fitting a real molecule")
