import { effect } from "@preact/signals";
import { render } from "preact";
import { link } from "./bus";
import { wizard } from "./calibrate/room";
import { startCalibration } from "./calibrate/state";
import { fileCommands, onKey, roomCommands, roomList, sideRooms } from "./commands";
import { startDeviation } from "./inspect/deviation";
import { ReplayDialog } from "./inspect/replay";
import { startShapes } from "./inspect/shapes";
import { scanName, startPart } from "./part";
import { startChoices } from "./repair/choices";
import { startColours } from "./repair/colours";
import { CopyEditsDialog } from "./repair/copying";
import { startRepair } from "./repair/state";
import { home, rooms } from "./rooms";
import { startExport } from "./rooms/export";
import { startLive } from "./scanner/live";
import { startDemo } from "./start/demo";
import { DropHint, startDrops } from "./start/drop";
import { place, startState } from "./state";
import { expose } from "./testing";
import "./theme.css";
import { closeDialog, dialogs } from "./ui/dialog";
import { KeySheet, Notices, Palette, StatusLine } from "./ui/frame";
import { InviteDialog } from "./ui/invite";
import { Alarm, StopButton, TopBar } from "./ui/topbar";
import { verbRoom } from "./verbs/form";
import { startPoints } from "./verbs/points";
import { openVerb, startVerbs, verbs } from "./verbs/state";

function room() {
  if (place.value.room.startsWith("do-")) return verbRoom;
  if (place.value.room === wizard.id) return wizard;
  const found = rooms.find(({ id }) => id === place.value.room);
  return found && (place.value.scan || !found.needsScan) ? found : home;
}

function App() {
  const { View, Status, title } = room();
  const modal = dialogs.value.length > 0;
  return (
    <div class="app">
      <div class="top">
        <TopBar />
        <StopButton />
      </div>
      <main style={{ display: "contents" }} aria-label={title} inert={modal}>
        <View />
      </main>
      <StatusLine>{Status && <Status />}</StatusLine>
      <Alarm />
      <Notices />
      {modal && <div class="scrim" onPointerDown={closeDialog} />}
      <Palette />
      <KeySheet />
      <InviteDialog />
      <CopyEditsDialog />
      <ReplayDialog />
      <DropHint />
    </div>
  );
}

startState();
startPart();
startLive();
startCalibration();
startRepair();
startChoices();
startExport();
startDeviation();
startColours();
startShapes();
startVerbs();
startDemo();
startPoints();
roomList.value = rooms;
sideRooms.value = [home, wizard];
effect(() => {
  roomCommands.value = room().commands;
});
effect(() => {
  document.title = scanName.value ? `${scanName.value} · turnscan` : "turnscan";
});
window.addEventListener("keydown", onKey);
effect(() => {
  fileCommands.value = verbs.value.map(({ verb, title }) => ({ title, group: "Files", run: () => openVerb(verb) }));
});
startDrops();
render(<App />, document.getElementById("app")!);
link.connect();
window.addEventListener("pagehide", () => link.leave());
expose();
