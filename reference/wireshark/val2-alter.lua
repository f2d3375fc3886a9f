-- VAL II ALTER between a Unimation controller and its host, as val2-alter.md describes it.
--
-- README.md says how to install it.

local alter = Proto("val2_alter", "VAL II ALTER")
local DLE, STX, ETX = 0x10, 0x02, 0x03

alter.prefs.robot_is_server = Pref.bool("The controller is the server of the TCP connection", true,
    "Whether the controller, or the adapter at its port, accepted the connection")
alter.prefs.leading_dle = Pref.uint("DLEs before STX (1 or 2)", 2)
alter.prefs.negated_sum = Pref.bool("The checksum is the two's complement of the sum", false)
alter.prefs.stuffed_checksum = Pref.bool("A checksum of 10h is doubled", false)
alter.prefs.ignore_spare_select = Pref.bool("Read select bits 6 and 7 as 0", false)

local ERRORS = { [0] = "none", "checksum", "format", "overflow", "incomplete", "mark", "timeout" }
local STATUS = {
    "no motion yet", "path is followed", "ended at its location", "nulling at a location not planned",
    "stopped at a location not planned", "HALT", "braking for REACTI or BREAK", "stopped for REACTI or BREAK",
    "braking for a fault", "stopped for a fault", "braking for a signal", "stopped for a signal", "near the target",
}
local EXCEPTIONS = { [0] = "none", [253] = "close the gripper", [254] = "open the gripper" }
local AXES = { "X", "Y", "Z", "RX", "RY", "RZ" }

local f = alter.fields
f.kind = ProtoField.string("val2_alter.kind", "Message")
f.marked = ProtoField.bool("val2_alter.marked", "Bit 7 of the control byte")
f.phase = ProtoField.string("val2_alter.phase", "Phase")
f.error = ProtoField.uint8("val2_alter.error", "Last answer", base.DEC, ERRORS)
f.mode = ProtoField.uint8("val2_alter.mode", "Mode", base.DEC)
f.cumulative = ProtoField.bool("val2_alter.mode.cumulative", "Cumulative", 8, nil, 0x01)
f.tool = ProtoField.bool("val2_alter.mode.tool", "Tool coordinates", 8, nil, 0x02)
f.has_transform = ProtoField.bool("val2_alter.mode.transform", "With transformation", 8, nil, 0x04)
f.from_joints = ProtoField.bool("val2_alter.mode.from_joints", "Transformation from joint angles", 8, nil, 0x08)
f.uses_inputs = ProtoField.bool("val2_alter.mode.uses_inputs", "Values change the path", 8, nil, 0x10)
f.data = ProtoField.int16("val2_alter.data", "List", base.DEC)
f.segment_status = ProtoField.uint8("val2_alter.segment_status", "Segment status", base.DEC, STATUS)
f.segment = ProtoField.uint16("val2_alter.segment", "Segment", base.DEC)
f.percent = ProtoField.uint16("val2_alter.percent", "Part of the segment that is done (16384 is all)", base.DEC)
f.transform = ProtoField.int16("val2_alter.transform", "Transformation", base.DEC)
f.reply = ProtoField.string("val2_alter.reply", "Answer")
f.exception = ProtoField.uint8("val2_alter.exception", "Exception", base.DEC, EXCEPTIONS)
f.values = ProtoField.int16("val2_alter.values", "Value", base.DEC)
f.checksum = ProtoField.uint8("val2_alter.checksum", "Checksum", base.HEX)
f.decode_error = ProtoField.string("val2_alter.decode_error", "Error")
f.request_in = ProtoField.framenum("val2_alter.request_in", "Message in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("val2_alter.response_time", "Response time in seconds")

local function expert_of(name, text, group, severity)
    return ProtoExpert.new("val2_alter." .. name, text, expert.group[group], expert.severity[severity])
end
local e = {
    checksum = expert_of("bad_checksum", "Bad checksum", "CHECKSUM", "ERROR"),
    corrupt = expert_of("corrupt", "Corrupt frame", "MALFORMED", "ERROR"),
    noise = expert_of("noise", "Bytes of no frame", "MALFORMED", "WARN"),
    unnamed = expert_of("unnamed", "Code that the source does not name", "UNDECODED", "NOTE"),
    rejected = expert_of("rejected", "The controller could not read the last answer", "RESPONSE_CODE", "WARN"),
    late = expert_of("late", "Reply after the window of 15 or 17 ms", "SEQUENCE", "WARN"),
    missed = expert_of("missed", "The message before was not answered", "SEQUENCE", "WARN"),
    stray = expert_of("stray", "Answer without a message", "SEQUENCE", "WARN"),
    wrong = expert_of("wrong_answer", "Answer of the other kind of message", "PROTOCOL", "ERROR"),
}
alter.experts = { e.checksum, e.corrupt, e.noise, e.unnamed, e.rejected, e.late, e.missed, e.stray, e.wrong }

local stream_field = Field.new("tcp.stream")
local streams, matches = {}, {}

function alter.init()
    streams, matches = {}, {}
end

--- The first start mark from `at` on: where it begins and its end; else nil and where a run of DLEs at the end begins.
local function find_mark(bytes, at)
    local run = 0
    for place = at, bytes:len() - 1 do
        local byte = bytes:get_index(place)
        if byte == DLE then
            run = run + 1
        elseif byte == STX and run >= alter.prefs.leading_dle then
            return place - run, place + 1
        else
            run = 0
        end
    end
    return nil, bytes:len() - run
end

local function read_fields(data, from_robot)
    if #data == 0 then return "length" end
    local first = data[1]
    if from_robot then
        local phase = bit.band(first, 0x78)
        if phase == 0x20 then return (#data < 2 or #data % 2 == 1) and "length" or nil end
        if first < 0x80 or bit.band(phase, 0x18) ~= 0 then return "control" end
        local is_end = phase == 0x60
        return #data ~= 6 and #data ~= 30 and not (is_end and #data == 1) and "length" or nil
    end
    if #data == 1 then return first > 1 and first ~= 0xFF and "start_reply" or nil end
    local select, words = data[2], 0
    if select > 63 and not alter.prefs.ignore_spare_select then return "select" end
    for axis = 0, 5 do words = words + bit.band(bit.rshift(select, axis), 1) end
    return #data ~= 2 + 2 * words and "reply_length" or nil
end

local function is_named(data, from_robot)
    if not from_robot then return #data == 1 or EXCEPTIONS[data[1]] ~= nil end
    local phase = bit.band(data[1], 0x60)
    if bit.band(data[1], 7) == 7 then return false end
    if phase == 0x20 then return data[1] >= 0x80 and data[2] < 32 end
    return phase == 0x60 or STATUS[data[2]] ~= nil
end

--- The frame whose start mark ends at `at`: its data, their places and its end; or nil, the error and its extent; or nil for more.
local function read_frame(bytes, at, to, from_robot, again)
    local data, places = {}, {}
    local limit = from_robot and 30 or 14
    while true do
        if at >= to then return nil end
        local byte = bytes:get_index(at)
        if byte == DLE then
            if at + 1 >= to then return nil end
            local after = bytes:get_index(at + 1)
            if after == ETX then break end
            if after ~= DLE then return nil, "end_mark", at + 1 end
        end
        if #data == limit then return nil, "too_long", at end
        table.insert(data, byte)
        table.insert(places, at)
        at = at + (byte == DLE and 2 or 1)
    end
    at = at + 2
    if at >= to then return nil end
    local sum = 0
    for _, byte in ipairs(data) do sum = sum + byte end
    if alter.prefs.negated_sum then sum = -sum end
    if bytes:get_index(at) ~= sum % 256 then return nil, "checksum", at end
    at = at + 1
    if alter.prefs.stuffed_checksum and sum % 256 == DLE then
        if at >= to then return nil end
        if bytes:get_index(at) ~= DLE then return nil, "end_mark", at end
        at = at + 1
    end
    local wrong = read_fields(data, from_robot) or again and not is_named(data, from_robot) and "length"
    if wrong then return nil, wrong, at end
    return { data = data, places = places, finish = at }
end

--- A word in the units of its axis, with the scaling of the PUMA 562.
local function in_units(name, word)
    if #name == 1 or name:sub(1, 1) == "p" then return string.format(" (%g mm)", word / 32) end
    if name:sub(1, 1) == "R" then return string.format(" (%.2f degrees)", word * 360 / 65536) end
    return string.format(" (%.4f)", word / 16384)
end

local function show_words(tree, tvb, frame, field, first, names)
    for index = first, #frame.data, 2 do
        local word = frame.data[index] + 256 * frame.data[index + 1]
        if word > 32767 then word = word - 65536 end
        local range = tvb(frame.places[index], frame.places[index + 1] - frame.places[index] + 1)
        local item = tree:add(field, range, word)
        if names then
            local name = names[(index - first) / 2 + 1]
            item:set_text(name .. ": " .. word .. in_units(name, word))
        end
    end
end

local function show_robot(tree, tvb, frame, info)
    local data, at = frame.data, function(index) return tvb(frame.places[index], 1) end
    local kind = ({ [0x20] = "start", [0x60] = "end" })[bit.band(data[1], 0x60)] or "motion"
    local error = bit.band(data[1], 7)
    tree:add(f.kind, at(1), kind)
    if kind == "motion" then
        tree:add(f.phase, at(1), bit.band(data[1], 0x40) == 0 and "running" or "interrupted")
    end
    if data[1] < 0x80 then tree:add(f.marked, at(1), false) end
    if kind ~= "start" or error ~= 0 then tree:add(f.error, at(1), error) end
    if error ~= 0 then tree:add_proto_expert_info(e.rejected) end
    if kind == "start" then
        local mode = tree:add(f.mode, at(2), data[2])
        for _, field in ipairs({ f.cumulative, f.tool, f.has_transform, f.from_joints, f.uses_inputs }) do
            mode:add(field, at(2), data[2])
        end
        show_words(tree, tvb, frame, f.data, 3)
    elseif kind == "motion" then
        tree:add(f.segment_status, at(2), data[2])
        tree:add(f.segment, at(3), data[3] + 256 * data[4])
        tree:add(f.percent, at(5), data[5] + 256 * data[6])
        show_words(tree, tvb, frame, f.transform, 7,
            { "nx", "ny", "nz", "ox", "oy", "oz", "ax", "ay", "az", "px", "py", "pz" })
    end
    table.insert(info, kind == "start" and "Start, mode " .. data[2] or kind == "end" and "End, error " .. error
        or "Segment " .. data[3] + 256 * data[4])
    return kind
end

local function show_host(tree, tvb, frame, info)
    local data, at = frame.data, function(index) return tvb(frame.places[index], 1) end
    if #data == 1 then
        local answer = ({ [0] = "accept", [1] = "repeat" })[data[1]] or "refuse"
        tree:add(f.kind, at(1), "start_reply")
        tree:add(f.reply, at(1), answer)
        table.insert(info, "Start: " .. answer)
        return "start_reply"
    end
    tree:add(f.kind, at(1), "reply")
    tree:add(f.exception, at(1), data[1])
    local names = {}
    for axis = 0, 5 do
        if bit.band(bit.rshift(data[2], axis), 1) == 1 then table.insert(names, AXES[axis + 1]) end
    end
    show_words(tree, tvb, frame, f.values, 3, names)
    table.insert(info, "Reply" .. (data[1] ~= 0 and ", exception " .. data[1] or ""))
    return "reply"
end

--- What the messages before make of this one, found in the first pass.
local function match(pinfo, tree, frame, kind)
    local key = pinfo.number .. ":" .. frame.places[1]
    if not pinfo.visited then
        local stream_info = stream_field()
        local number = stream_info and stream_info.value or 0
        local stream = streams[number] or {}
        streams[number] = stream
        local now = tonumber(tostring(pinfo.abs_ts))
        local request = stream.request
        if kind == "reply" or kind == "start_reply" then
            local found = { expert = not request and e.stray or nil }
            if request then
                found.number, found.time = request.number, now - request.time
                if (kind == "reply") ~= (request.kind == "motion") then
                    found.expert = e.wrong
                elseif found.time > (stream.mode and stream.mode % 2 == 1 and 0.015 or 0.017) then
                    found.expert = e.late
                end
            end
            matches[key] = found
            stream.request = nil
        else
            matches[key] = { expert = request and e.missed or nil }
            stream.request = kind ~= "end" and { number = pinfo.number, time = now, kind = kind } or nil
            if kind == "start" then stream.mode = frame.data[2] end
        end
    end
    local found = matches[key] or {}
    if found.number then
        tree:add(f.request_in, found.number):set_generated()
        tree:add(f.response_time, found.time):set_generated()
    end
    if found.expert then tree:add_proto_expert_info(found.expert) end
end

local function show_error(tvb, tree, at, to, kind, info)
    local item = tree:add(alter, tvb(at, to - at))
    item:add(f.decode_error, tvb(at, to - at), kind)
    item:add_proto_expert_info(kind == "checksum" and e.checksum or kind == "start_mark" and e.noise or e.corrupt)
    table.insert(info, "Error " .. kind)
end

--- Where the next frame may begin after a corrupt one: a start mark after which nothing is wrong yet within its bytes.
local function resume(bytes, at, extent, from_robot)
    local start, data = find_mark(bytes, at)
    while start do
        local _, wrong = read_frame(bytes, data, math.max(data, extent), from_robot, true)
        if start >= extent or not wrong then return start end
        start, data = find_mark(bytes, start + 1)
    end
    return data
end

function alter.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "ALTER"
    local from_robot = (pinfo.src_port == pinfo.match_uint) == alter.prefs.robot_is_server
    local bytes, info = tvb:bytes(), {}
    local at, reread_to, lent = 0, 0, 0
    while at < tvb:len() do
        -- A checksum of 10h may be the first DLE of the next start mark too.
        local start, data = find_mark(bytes, at - lent)
        local clean = math.max(start or data, at)
        start, lent = start and clean, 0
        if clean > at then
            show_error(tvb, tree, at, clean, "start_mark", info)
            at = clean
        end
        local frame, wrong, extent
        if start then frame, wrong, extent = read_frame(bytes, data, tvb:len(), from_robot, start < reread_to) end
        if wrong then
            reread_to = math.max(reread_to, extent)
            at = resume(bytes, start + 1, reread_to, from_robot)
            show_error(tvb, tree, start, at, wrong, info)
        elseif frame then
            local item = tree:add(alter, tvb(start, frame.finish - start))
            local kind = (from_robot and show_robot or show_host)(item, tvb, frame, info)
            item:add(f.checksum, tvb(frame.finish - 1, 1))
            if not is_named(frame.data, from_robot) then item:add_proto_expert_info(e.unnamed) end
            match(pinfo, item, frame, kind)
            at = frame.finish
            lent = bytes:get_index(at - 1) == DLE and not alter.prefs.stuffed_checksum and 1 or 0
        elseif at < tvb:len() then
            pinfo.desegment_offset = at
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            break
        end
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

DissectorTable.get("tcp.port"):add_for_decode_as(alter)
