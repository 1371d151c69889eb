# Manual pages and bash completion, made by running the tool's help: one source for all three.
if(CMAKE_CROSSCOMPILING)
  message(STATUS "Cross compiling: no manual pages, no bash completion")
  return()
endif()
set(manual ${PROJECT_BINARY_DIR}/manual)
add_custom_command(OUTPUT ${manual}/ovoid.bash
  COMMAND sh ${PROJECT_SOURCE_DIR}/cmake/manual.sh $<TARGET_FILE:ovoid_tool>
    ${PROJECT_SOURCE_DIR}/cmake ${manual}
  DEPENDS ovoid_tool cmake/manual.sh cmake/manpage.awk cmake/completion.awk cmake/completion.bash
    docs/ovoid.roff
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
  VERBATIM COMMENT "Making the manual pages and the bash completion from the help")
add_custom_target(manual ALL DEPENDS ${manual}/ovoid.bash)
install(DIRECTORY ${manual}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR})
install(FILES ${manual}/ovoid.bash
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME ovoid)
