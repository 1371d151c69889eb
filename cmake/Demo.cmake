# `cmake --workflow --preset demo`, or the target `demo`: fits a real molecule and says what it does.
set(OVOID_DEMO_MOLECULE /usr/share/pymol/data/tut/1hpv.pdb CACHE FILEPATH
  "Molecule of the target demo (this one comes with Debian's package pymol-data)")
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
