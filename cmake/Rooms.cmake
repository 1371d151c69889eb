# One object library per room; a room uses only the rooms named before it (cli uses the public header).
function(ovoid_room name)
  cmake_parse_arguments(ROOM "" "" "SOURCES;LINK" ${ARGN})
  add_library(ov_${name} OBJECT ${ROOM_SOURCES})
  target_include_directories(ov_${name} PRIVATE ${PROJECT_SOURCE_DIR}/include
    ${PROJECT_SOURCE_DIR}/host ${PROJECT_SOURCE_DIR}/kernels)
  target_link_libraries(ov_${name} PRIVATE ovoid_flags ${ROOM_LINK})
  set_target_properties(ov_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  set_property(GLOBAL APPEND PROPERTY OVOID_ROOMS ov_${name})
endfunction()

