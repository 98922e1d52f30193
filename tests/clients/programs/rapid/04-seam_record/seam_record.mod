MODULE Seam
  RECORD seampoint
    robtarget at;
    num width;
  ENDRECORD
  RECORD seam
    seampoint first;
    seampoint last;
    string label;
  ENDRECORD
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST seam s1:=[[[[0,110,360],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],4.5],[[[0,240,362.5],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],4.5],"naht [1]"];
  PROC main()
    MoveL s1.first.at,v100,fine,tSpindle\WObj:=wPanel;
    MoveL s1.last.at,v20,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
